//! The signals that are needed, out of the frames as they come.

use can_dbc::{Dbc, Message, Signal};
use haptic_log::bus::BusFrame;
use haptic_log::formats::dbc::{identifier, raw};

use super::protection::Auditor;
use super::{Course, LogError, refuse};

/// A message that carries signals that are needed.
struct Carrier<'a> {
    message: &'a Message,
    bus: Option<String>,
    auditor: Auditor,
    line: Vec<u32>,
    time_s: Vec<f64>,
    too_short: usize,
}

/// A needed signal, the place of its carrier, and its values in SI units.
struct Needed<'a> {
    name: &'static str,
    signal: &'a Signal,
    carrier: usize,
    value: Vec<f64>,
}

/// What was heard of the signals that are needed.
pub(super) struct Heard<'a> {
    carriers: Vec<Carrier<'a>>,
    needed: Vec<Needed<'a>>,
}

impl<'a> Heard<'a> {
    /// Of these signals, which a DBC file has to know.
    pub(super) fn of(names: &[&'static str], dbc: &'a Dbc) -> Result<Self, LogError> {
        let mut heard = Self {
            carriers: Vec::new(),
            needed: Vec::new(),
        };
        for name in names {
            let mut messages = dbc.messages.iter();
            let found = messages.find_map(|m| Some((m, m.signals.iter().find(|s| s.name == *name)?)));
            let Some((message, signal)) = found else {
                return refuse(format!("the DBC file has no signal {name}"));
            };
            let known = heard.carriers.iter().position(|c| c.message.id == message.id);
            let carrier = known.unwrap_or(heard.carriers.len());
            if known.is_none() {
                heard.carriers.push(Carrier {
                    message,
                    bus: None,
                    auditor: Auditor::of(dbc, message),
                    line: Vec::new(),
                    time_s: Vec::new(),
                    too_short: 0,
                });
            }
            heard.needed.push(Needed {
                name,
                signal,
                carrier,
                value: Vec::new(),
            });
        }
        Ok(heard)
    }

    /// Takes what a frame says, if it is one of those that are needed.
    pub(super) fn take(&mut self, frame: &BusFrame) -> Result<(), LogError> {
        let own = (frame.id, frame.extended);
        let Some(place) = self.carriers.iter().position(|c| identifier(c.message.id) == own) else {
            return Ok(());
        };
        let carrier = &mut self.carriers[place];
        let bus = carrier.bus.get_or_insert_with(|| frame.bus.clone());
        if *bus != frame.bus {
            let (name, other) = (&carrier.message.name, &frame.bus);
            return refuse(format!(
                "message {name} is on the buses {bus} and {other}: say with --bus which is meant"
            ));
        }
        if !carrier.auditor.takes(frame) {
            return Ok(());
        }
        let mut signals = self.needed.iter_mut().filter(|needed| needed.carrier == place);
        if signals.any(|needed| raw(needed.signal, &frame.data).is_none()) {
            carrier.too_short += 1;
            return Ok(());
        }
        carrier.line.push(u32::try_from(frame.line).unwrap_or(u32::MAX));
        carrier.time_s.push(frame.time_s);
        for needed in self.needed.iter_mut().filter(|needed| needed.carrier == place) {
            let signal = needed.signal;
            let unit = match signal.unit.as_str() {
                "deg" => std::f64::consts::PI / 180.0,
                "ms" => 1e-3,
                _ => 1.0,
            };
            let bits = raw(signal, &frame.data).unwrap_or_default();
            needed
                .value
                .push((bits as f64 * signal.factor + signal.offset) * unit);
        }
        Ok(())
    }

    /// What became of the frames, in words.
    pub(super) fn findings(&self) -> Vec<[String; 3]> {
        let too_short = |carrier: &Carrier<'_>| {
            let (name, count) = (carrier.message.name.clone(), carrier.too_short);
            (count > 0).then(|| {
                [
                    name,
                    format!("{count} frames too short for its signals"),
                    "not used".into(),
                ]
            })
        };
        let of = |carrier: &Carrier<'_>| [carrier.auditor.finding(&carrier.time_s), too_short(carrier)];
        self.carriers.iter().flat_map(of).flatten().collect()
    }

    /// The signals, in the order in which they were asked for.
    pub(super) fn courses(self) -> Result<Vec<Course>, LogError> {
        let carriers = self.carriers;
        let course = |needed: Needed<'_>| {
            let carrier = &carriers[needed.carrier];
            let (message, name) = (carrier.message, needed.name);
            if needed.value.len() < 2 {
                let ((id, _), seen) = (identifier(message.id), carrier.auditor.frames());
                return refuse(match seen {
                    0 | 1 => format!("no frame {id:03X} ({}), so no {name}", message.name),
                    _ => format!(
                        "none of {seen} frames {id:03X} ({}) has a right CRC and its length, so no {name}",
                        message.name
                    ),
                });
            }
            Ok(Course {
                name,
                line: carrier.line.clone(),
                time_s: carrier.time_s.clone(),
                value: needed.value,
            })
        };
        self.needed.into_iter().map(course).collect()
    }
}
