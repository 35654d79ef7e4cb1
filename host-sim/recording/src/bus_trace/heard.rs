//! The signals that are needed, out of the frames as they come.

use can_dbc::{Dbc, Message, Signal};
use haptic_log::bus::BusFrame;
use haptic_log::formats::dbc::{identifier, raw};
use haptic_log::formats::protection::Auditor;

use super::{AGE, E_THETA, E_Y, LogError, VALID, refuse};

/// A value of a needed signal, in SI units.
pub(super) struct Value {
    /// Place of the signal in [`NEEDED`](super::NEEDED).
    pub(super) signal: usize,
    pub(super) line: u32,
    /// When it was measured.
    pub(super) time_s: f64,
    pub(super) value: f64,
}

/// A message that carries signals that are needed.
struct Carrier<'a> {
    message: &'a Message,
    bus: Option<String>,
    auditor: Auditor,
    /// Frames whose signals were read.
    read: usize,
    too_short: usize,
}

/// A needed signal, the place of its carrier, and its latest value.
struct Needed<'a> {
    name: &'static str,
    signal: &'a Signal,
    carrier: usize,
    value: f64,
    /// When the latest value that was handed on was measured.
    last_s: f64,
}

/// What was heard of the signals that are needed.
pub(super) struct Heard<'a> {
    carriers: Vec<Carrier<'a>>,
    needed: Vec<Needed<'a>>,
    /// Frames of the lane preview that say that they are not valid.
    not_valid: usize,
}

impl<'a> Heard<'a> {
    /// Hears these signals, which a DBC file has to know.
    pub(super) fn of(names: &[&'static str], dbc: &'a Dbc) -> Result<Self, LogError> {
        let mut heard = Self {
            carriers: Vec::new(),
            needed: Vec::new(),
            not_valid: 0,
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
                    read: 0,
                    too_short: 0,
                });
            }
            heard.needed.push(Needed {
                name,
                signal,
                carrier,
                value: 0.0,
                last_s: f64::NEG_INFINITY,
            });
        }
        Ok(heard)
    }

    /// Hands on what a frame says, if it is one of those that are needed.
    pub(super) fn take(&mut self, frame: &BusFrame, each: &mut dyn FnMut(&Value)) -> Result<(), LogError> {
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
        carrier.read += 1;
        for needed in self.needed.iter_mut().filter(|needed| needed.carrier == place) {
            let signal = needed.signal;
            let unit = match signal.unit.as_str() {
                "deg" => std::f64::consts::PI / 180.0,
                "ms" => 1e-3,
                _ => 1.0,
            };
            let bits = raw(signal, &frame.data).unwrap_or_default();
            needed.value = (bits as f64 * signal.factor + signal.offset) * unit;
        }
        self.hand_on(place, frame, each);
        Ok(())
    }

    /// The values that a carrier brought: those of the lane where it is valid, at the time when the camera saw it.
    fn hand_on(&mut self, carrier: usize, frame: &BusFrame, each: &mut dyn FnMut(&Value)) {
        let line = u32::try_from(frame.line).unwrap_or(u32::MAX);
        let (is_valid, age_s) = (self.needed[VALID].value != 0.0, self.needed[AGE].value);
        for (signal, needed) in self.needed.iter_mut().enumerate() {
            if needed.carrier != carrier {
                continue;
            }
            let mut time_s = frame.time_s;
            match signal {
                VALID => {
                    self.not_valid += usize::from(!is_valid);
                    continue;
                }
                AGE => continue,
                E_Y | E_THETA => {
                    time_s -= age_s;
                    // A picture that comes again, or out of turn, tells nothing new.
                    if !is_valid || time_s <= needed.last_s {
                        continue;
                    }
                }
                _ => {}
            }
            needed.last_s = time_s;
            each(&Value {
                signal,
                line,
                time_s,
                value: needed.value,
            });
        }
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
        let not_valid = (self.not_valid > 0).then(|| {
            [
                "LanePreview".to_owned(),
                format!("{} frames that say that they are not valid", self.not_valid),
                "not used".to_owned(),
            ]
        });
        let of = |carrier: &Carrier<'_>| [carrier.auditor.finding(), too_short(carrier)];
        let each = self.carriers.iter().flat_map(of).flatten();
        each.chain(not_valid).collect()
    }

    /// # Errors
    /// A signal without values.
    pub(super) fn check(&self) -> Result<(), LogError> {
        for needed in &self.needed {
            let carrier = &self.carriers[needed.carrier];
            if carrier.read < 2 {
                let (message, name) = (carrier.message, needed.name);
                let (id, _) = identifier(message.id);
                return refuse(match carrier.auditor.frames() {
                    0 | 1 => format!("no frame {id:03X} ({}), so no {name}", message.name),
                    seen => format!(
                        "none of {seen} frames {id:03X} ({}) has a right CRC and its length, so no {name}",
                        message.name
                    ),
                });
            }
        }
        Ok(())
    }
}
