//! The shipping ECU on recordings of real people: which of its checks would have ended guidance.
//!
//! The recorded signals come as frames of the ECU's own bus, with CRC and counter, and guidance is asked for throughout. The
//! recorded guidance torque stands in the place of the law's, so that what the ECU commands is what the column felt; the motor delivers
//! what is commanded. Rows of 10 Hz are slower than the bus: between them the signals are held, or on a line, or nothing is sent.
//!
//! What the recordings lack is made up, and cannot fail here: a lane at a camera's rate (it is the way that the vehicle goes), a
//! second speed (the first), a motor's report (the command).

use haptic_core::bus::Frame;
use haptic_core::bus::messages::{Column, LanePreview, Message, Request, Vehicle};
use haptic_core::controller::config::Setup;
use haptic_core::ecu::Ecu;
use haptic_core::quantity::{Instant, Metres, Micros, Radians, Ratio, Speed, Torque, TurningRate};
use haptic_core::safety::envelope::LimitReason;
use haptic_core::safety::modes::Mode;
use haptic_sim::models::sensors;
use serde::Serialize;

use super::rows::Rows;
use crate::declared::{Listener, UNNAMED};
use haptic_batch::{Confidence, Rate};

/// Rows further apart are a gap, in which nothing is sent, s.
const GAP_S: f64 = 0.25;

/// What is sent between two rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Feed {
    /// The values on the line between them.
    Line,
    /// The first one's.
    Held,
    /// Nothing: the recorded rate.
    Nothing,
}

impl Feed {
    /// Every one.
    pub const ALL: [Self; 3] = [Self::Line, Self::Held, Self::Nothing];
}

/// What the ECU did with recordings.
#[derive(Debug, Clone, Serialize)]
pub struct Fed {
    /// What was sent between rows.
    pub feed: Feed,
    /// Hours by hand, and shared.
    pub hours: [f64; 2],
    /// Hours of these with guidance.
    pub guided_h: [f64; 2],
    /// Hours in which the driver's override held the torque back.
    pub overridden_h: f64,
    /// What ended guidance, each by itself.
    pub ends: Vec<End>,
    /// What ended guidance in all recordings: all, then by cause, the most frequent first.
    pub endings: Vec<Ending>,
}

/// An end of guidance, and what was recorded in the second before.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct End {
    /// The recording.
    pub file: String,
    /// When, s since its start.
    pub time_s: f64,
    /// Whether driving was shared.
    pub shared: bool,
    /// The faults that the ECU named.
    pub faults: String,
    /// T_d, the mean, N.m.
    pub driver_nm: f64,
    /// T_h, the mean, N.m.
    pub guidance_nm: f64,
    /// From the least to the largest wheel angle, deg.
    pub wheel_deg: f64,
}

/// Ends of guidance of one cause.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ending {
    /// The faults that the ECU named.
    pub faults: String,
    /// By hand, and shared: how often in an hour of guidance.
    pub rates: [Rate; 2],
}

/// The bus between a recording and an ECU.
struct Senders<'a> {
    rows: &'a Rows,
    feed: Feed,
    /// The row of now.
    row: usize,
    counters: [u8; 4],
}

impl Senders<'_> {
    fn value(&self, of: &[f64], time_s: f64) -> f64 {
        let next = (self.row + 1).min(of.len() - 1);
        let [from_s, to_s] = [self.row, next].map(|row| self.rows.time_s[row]);
        if self.feed == Feed::Line && to_s > from_s {
            of[self.row] + (time_s - from_s) / (to_s - from_s) * (of[next] - of[self.row])
        } else {
            of[self.row]
        }
    }

    /// The frames of a step of 1 ms.
    fn send(&mut self, step: u32, time_s: f64, engage: bool, applied: Torque) -> Vec<Frame> {
        let rows = self.rows;
        let before = self.row;
        while rows.time_s.get(self.row + 1).is_some_and(|t| *t <= time_s) {
            self.row += 1;
        }
        let is_new = step == 0 || self.row > before;
        let since_s = time_s - rows.time_s[self.row];
        let is_due = |due| (if self.feed == Feed::Nothing { is_new } else { due }) && since_s < GAP_S;
        let now = |of: &[f64]| self.value(of, time_s);
        let lane = LanePreview {
            e_y: Metres::from_m(now(&rows.e_y_m)),
            e_theta: Radians::from_rad(now(&rows.e_theta_rad)),
            // A picture that is held grows old.
            age: Micros::from_us(if self.feed == Feed::Held {
                (since_s * 1e6) as u32
            } else {
                0
            }),
            valid: true,
        };
        let column = Column {
            driver_torque: Torque::from_nm(now(&rows.driver_nm)),
            wheel_angle: Radians::from_rad(now(&rows.wheel_rad)),
            motor_torque: applied,
        };
        let vehicle = Vehicle {
            speeds: [Speed::from_m_per_s(now(&rows.speed_m_per_s)); 2],
            yaw_rate: Some(TurningRate::from_rad_per_s(now(&rows.yaw_rate_rad_per_s))),
        };
        let request = Request {
            engage,
            authority: Ratio::ONE,
            probe: false,
        };
        let [a, b, c, d] = self.counters;
        let due = [
            (is_due(sensors::camera_looks(step)), lane.encode(a)),
            (is_due(step.is_multiple_of(2)), column.encode(b)),
            (is_due(step.is_multiple_of(10)), vehicle.encode(c)),
            // The request is nobody's recording.
            (step.is_multiple_of(10), request.encode(d)),
        ];
        for (counter, (due, _)) in self.counters.iter_mut().zip(&due) {
            *counter = counter.wrapping_add(u8::from(*due));
        }
        due.into_iter()
            .filter_map(|(due, frame)| due.then_some(frame))
            .collect()
    }
}

/// Feeds a recording to an ECU that guides from the start on and is asked again 5 s after each end.
pub(super) fn fed(rows: &Rows, feed: Feed, file: &str) -> Fed {
    let setup = Setup {
        // The recorded torque is not that of our law, and the monitor would refuse it.
        monitor: Setup::PAPER.monitor.with_another_law(),
        ..Setup::PAPER
    };
    let mut ecu = Ecu::engaged(&setup, Instant::from_us(0));
    let mut listener = Listener::new();
    let mut senders = Senders {
        rows,
        feed,
        row: 0,
        counters: [0; 4],
    };
    let (mut steps, mut guided, mut overridden) = ([0_u32; 2], [0_u32; 2], 0_u32);
    let mut at_rows = Vec::new();
    let (Some(start_s), Some(end_s)) = (rows.time_s.first(), rows.time_s.last()) else {
        unreachable!("a recording has rows")
    };
    for step in 0..((end_s - start_s) * 1e3) as u32 {
        let time_s = start_s + f64::from(step) * 1e-3;
        let now = Instant::from_us(step.wrapping_mul(1000));
        let applied = listener.said.map_or(Torque::ZERO, |said| said.torque);
        for frame in senders.send(step, time_s, listener.engages(), applied) {
            // The ECU judges by itself and reports what it misses.
            let _ = ecu.receive(&frame, now);
        }
        let asked = Torque::from_nm(senders.value(&rows.guidance_nm, time_s));
        let out = ecu.step_with_law(now, asked);
        let _ = ecu.background_step();
        listener.take_frame(time_s, Some(&out.guidance));
        let part = usize::from(rows.shared[senders.row]);
        steps[part] += 1;
        if listener.reported.mode == Mode::Active {
            guided[part] += 1;
            let limit = listener.said.map(|said| said.limit);
            overridden += u32::from(limit == Some(LimitReason::DriverOverride));
        }
        // A declaration of this step gets the row of now.
        at_rows.resize(listener.reported.declarations.len(), senders.row);
    }
    let hours = |steps: u32| f64::from(steps) / 3.6e6;
    // Without a fault it was the request that ended, or the vehicle was too slow.
    let ends = listener.reported.declarations.into_iter().zip(at_rows);
    let ends = ends.filter(|(end, _)| end.faults != UNNAMED);
    Fed {
        feed,
        hours: steps.map(hours),
        guided_h: guided.map(hours),
        overridden_h: hours(overridden),
        ends: ends.map(|(end, row)| rows.end(file, end.faults, row)).collect(),
        endings: Vec::new(),
    }
}

impl Rows {
    fn end(&self, file: &str, faults: String, row: usize) -> End {
        let since = self.time_s.partition_point(|t| *t < self.time_s[row] - 1.0);
        let second = since..row + 1;
        let mean = |of: &[f64]| of[second.clone()].iter().sum::<f64>() / second.len() as f64;
        let wheel = &self.wheel_rad[second.clone()];
        let most = wheel.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let least = wheel.iter().copied().fold(f64::INFINITY, f64::min);
        End {
            file: file.into(),
            time_s: self.time_s[row] - self.time_s[0],
            shared: self.shared[row],
            faults,
            driver_nm: mean(&self.driver_nm),
            guidance_nm: mean(&self.guidance_nm),
            wheel_deg: (most - least).to_degrees(),
        }
    }
}

/// What all recordings showed, by feed.
pub(super) fn together<'a>(recordings: impl Iterator<Item = &'a [Fed]> + Clone) -> Vec<Fed> {
    let of_feed = |feed: Feed| {
        let all = || recordings.clone().flatten().filter(move |fed| fed.feed == feed);
        let sum =
            |of: &dyn Fn(&Fed) -> [f64; 2]| all().map(of).fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        let guided_h = sum(&|fed| fed.guided_h);
        let ends: Vec<End> = all().flat_map(|fed| fed.ends.clone()).collect();
        let mut names: Vec<&str> = ends.iter().map(|end| end.faults.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        let ending = |name: Option<&str>| Ending {
            faults: name.unwrap_or("all").into(),
            rates: [0, 1].map(|part| {
                let is_of = |end: &&End| {
                    usize::from(end.shared) == part && name.is_none_or(|name| name == end.faults)
                };
                Rate::new(
                    ends.iter().filter(is_of).count() as u64,
                    guided_h[part],
                    Confidence::USUAL,
                )
            }),
        };
        let mut causes: Vec<Ending> = names.iter().map(|name| ending(Some(name))).collect();
        causes.sort_by_key(|end| std::cmp::Reverse(end.rates[0].count + end.rates[1].count));
        Fed {
            feed,
            hours: sum(&|fed| fed.hours),
            guided_h,
            overridden_h: all().map(|fed| fed.overridden_h).sum(),
            endings: std::iter::once(ending(None)).chain(causes).collect(),
            ends,
        }
    };
    Feed::ALL.map(of_feed).into()
}
