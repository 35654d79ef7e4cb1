//! A study of one's own in one file: the peak lateral error of two laws against speed, as they are, after a sudden loss of the torque, and
//! after a lane that falls silent. `cargo run --release -p haptic-batch --example peak_against_speed`

use haptic_batch::compare::{Chosen, Kinds};
use haptic_batch::engine::{After, Faults, Part, Plan, Study, Watch, drive_forked, failures, trunk};
use haptic_batch::{Confidence, Mean, StudyError, peak_m};
use haptic_sim::scenario::{Condition, FailureKind, Scenario};

const LAWS: [&str; 2] = ["paper", "fdca"];
const SPEEDS_KMH: [f64; 3] = [40.0, 60.0, 80.0];
/// Drives of a law at a speed, each with its own remnant.
const SEEDS: u64 = 3;
/// Two instants of each failure in a drive; a peak is looked for in the 8 s behind it.
pub(crate) const FAULTS: Faults = Faults {
    sudden_loss: 2,
    silent_lane: 2,
    lasts_s: 8.0,
};

/// The study; its results are a row for each law and speed: nominal, worst after a loss, worst after a silent lane, m.
pub(crate) struct PeakAgainstSpeed(pub(crate) Confidence);

pub(crate) type Case = (&'static str, f64, u64);

pub(crate) fn scenario((_, speed_kmh, seed): Case) -> Result<Scenario, StudyError> {
    let mut driver = *Scenario::default().driver();
    driver.remnant_sd_nm = 0.1;
    let builder = Scenario::builder().condition(Condition::Mid).driver(driver);
    Ok(builder.speed_kmh(speed_kmh).seed(seed).build()?)
}

impl Study for PeakAgainstSpeed {
    type Case = Case;
    type Row = [f64; 3];
    type Results = Vec<(Case, [Mean; 3])>;

    fn plan(&self) -> Result<Plan<Case>, StudyError> {
        let places = LAWS.iter().flat_map(|law| SPEEDS_KMH.map(|kmh| (*law, kmh)));
        let cases = places.flat_map(|(law, kmh)| (1..=SEEDS).map(move |seed| (law, kmh, seed)));
        Ok(Plan::one_by_one(cases.collect()))
    }

    fn drive(&self, part: &Part<'_, Case, [f64; 3]>) -> Result<Vec<[f64; 3]>, StudyError> {
        let kinds = Kinds::default();
        part.one_by_one(|case| {
            let scenario = scenario(*case)?;
            let law = Chosen::named(&kinds.laws, case.0)?.untuned_part(&scenario)?;
            let driver = Chosen::named(&kinds.drivers, "paper")?.untuned_part(&scenario)?;
            let (trunk, failures) = (trunk(&scenario, law, driver), failures(&scenario, FAULTS));
            let (run, behind) = drive_forked(trunk, &failures, FAULTS.lasts_s, After::new);
            let mut peaks_m = [peak_m(&run, [0.0, f64::INFINITY]), 0.0, 0.0];
            for After { kind, peak_m, .. } in behind {
                let worst_m = &mut peaks_m[if kind == FailureKind::Torque { 1 } else { 2 }];
                *worst_m = worst_m.max(peak_m);
            }
            Ok(peaks_m)
        })
    }

    fn summarise(&self, cases: Vec<Case>, rows: Vec<[f64; 3]>) -> Result<Self::Results, StudyError> {
        let groups = cases.chunks(SEEDS as usize).zip(rows.chunks(SEEDS as usize));
        let mean = |rows: &[[f64; 3]], which: usize| {
            Mean::new(&rows.iter().map(|row| row[which]).collect::<Vec<_>>(), self.0).ok_or("no drive")
        };
        let row = |(cases, rows): (&[Case], &[[f64; 3]])| {
            Ok((cases[0], [mean(rows, 0)?, mean(rows, 1)?, mean(rows, 2)?]))
        };
        groups.map(row).collect()
    }
}

fn main() -> Result<(), StudyError> {
    println!("law, km/h: peak, worst after a loss, worst after a silent lane, m, with 95 % intervals");
    for ((law, kmh, _), means) in PeakAgainstSpeed(Confidence::USUAL).run(&Watch::nobody())? {
        println!("{law}, {kmh}: {}", means.map(|mean| mean.to_string()).join(", "));
    }
    Ok(())
}
