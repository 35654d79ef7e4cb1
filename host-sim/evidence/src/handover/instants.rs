//! What came of every instant of a failure, and a row of the results over many of them.

use haptic_sim::scenario::{Condition, FailureKind};

use super::{Bend, Drive, Driver, Figure, HandoverRow, Peaks, Place};

/// What is left of the lane beside a vehicle of 1.7 m in its middle, m.
const IN_LANE_M: f64 = 0.95;

/// What came of one instant, for the two ways to fail.
#[derive(Debug, Clone)]
pub(super) struct Instant {
    pub(super) driver: Driver,
    pub(super) condition: Condition,
    takes_over_after_s: f64,
    pub(super) at_s: f64,
    /// The handover's peak and the drop's, and the larger of those without a failure and by hand, m.
    pub(super) peaks_m: [f64; 3],
    left_by_itself: usize,
}

impl Instant {
    fn handover(&self) -> f64 {
        self.peaks_m[0] / self.peaks_m[2]
    }

    fn drop(&self) -> f64 {
        self.peaks_m[1] / self.peaks_m[2]
    }

    fn beside_drop(&self) -> f64 {
        let [handover, drop, usual] = self.peaks_m;
        handover.max(usual) / drop.max(usual)
    }

    fn place(&self) -> Place {
        let Driver { bend, side, t_p } = self.driver;
        Place {
            speed_kmh: bend.speed_kmh,
            radius_m: bend.radius_m,
            side,
            t_p,
            instant_s: self.at_s - bend.begins_s(),
            place: bend.place(self.at_s),
        }
    }
}

/// What came of every instant, for the drivers who are judged in their bend.
pub(super) fn instants(drives: &[Drive], peaks: &[Peaks]) -> Vec<Instant> {
    let mut found = Vec::new();
    let mut rest = peaks;
    for of_driver in drives.chunk_by(|a, b| a.driver == b.driver) {
        let (own, others) = rest.split_at(of_driver.len());
        rest = others;
        // The first is by hand.
        if own[0].settles && own[0].peak_m <= IN_LANE_M {
            instants_of_driver(of_driver, own, &mut found);
        }
    }
    found
}

/// From the drives in the order of [`super::drives_of`].
fn instants_of_driver(drives: &[Drive], peaks: &[Peaks], found: &mut Vec<Instant>) {
    let [by_hand, mut nominal, mut handed] = [peaks[0]; 3];
    for (drive, own) in drives.iter().zip(peaks).skip(1) {
        match drive.failure.kind {
            FailureKind::None => nominal = *own,
            // KINDS has the input first, so this is the handover of the same instant as the drop behind it.
            FailureKind::Input => handed = *own,
            FailureKind::Torque => {
                let of_instant = [nominal, handed, *own];
                found.push(Instant {
                    driver: drive.driver,
                    condition: drive.condition,
                    takes_over_after_s: drive.takes_over_after_s,
                    at_s: drive.failure.time_s,
                    peaks_m: [handed.peak_m, own.peak_m, nominal.peak_m.max(by_hand.peak_m)],
                    left_by_itself: of_instant.iter().filter(|drive| drive.left_by_itself).count(),
                });
            }
        }
    }
}

pub(super) fn row(
    all: &[Instant],
    bend: Option<Bend>,
    condition: Condition,
    takes_over_after_s: f64,
) -> HandoverRow {
    let is_here = |instant: &Instant| {
        let own = instant.driver.bend;
        bend.map_or(!own.is_papers, |bend| bend == own)
    };
    let is_asked = |instant: &&Instant| {
        is_here(instant) && instant.condition == condition && instant.takes_over_after_s == takes_over_after_s
    };
    let instants: Vec<&Instant> = all.iter().filter(is_asked).collect();
    HandoverRow {
        bend,
        condition,
        takes_over_after_s,
        instants: instants.len(),
        handover: figure(&instants, 0, Instant::handover),
        drop: figure(&instants, 1, Instant::drop),
        beside_drop: figure(&instants, 0, Instant::beside_drop),
        left_by_itself: instants.iter().map(|instant| instant.left_by_itself).sum(),
    }
}

/// A figure of the drives whose peaks are in this place of an instant's.
fn figure(instants: &[&Instant], peak: usize, of: impl Fn(&Instant) -> f64) -> Option<Figure> {
    let mut values: Vec<f64> = instants.iter().map(|instant| of(instant)).collect();
    values.sort_by(f64::total_cmp);
    let worst = instants.iter().max_by(|a, b| of(a).total_cmp(&of(b)))?;
    Some(Figure {
        worst: of(worst),
        worst_peak_m: worst.peaks_m[peak],
        median: values[values.len() / 2],
        at: worst.place(),
    })
}
