//! A chunk of vectorised runs ([`crate::vectorised`]), and the shipping ECU for those that are rejected.

use haptic_sim::input::InputError;
use haptic_sim::scenario::{Failure, FailureKind, Scenario};
use haptic_sim::simulation::{Run, simulate};
use haptic_vectorised::Options;

use super::{Chunk, Driven, Sweep};
use crate::engine::{Checked, Group};
use crate::record::nominal_peak_m;

impl Sweep {
    /// Drives a chunk. What it gives follows from the sweep and the number alone.
    ///
    /// # Errors
    /// As [`Sweep::scenario`]; a drive that differs from the shipping ECU's.
    pub fn run_chunk(&self, number: u64) -> Result<Chunk, InputError> {
        let drives = self.drives_of(number);
        let mut scenarios: Vec<Scenario> = Vec::new();
        for drive in drives.clone() {
            let mut scenario = self.scenario(&self.point(drive))?;
            if let Some(before) = scenarios.last() {
                scenario.share_road(before);
            }
            scenarios.push(scenario);
        }
        let rows = self.run_batched(drives.start, &scenarios)?;
        let rows = rows.into_iter().zip(&scenarios);
        let rows = rows.map(|(row, scenario)| row.map_or_else(|| self.run_alone(scenario), Ok));
        Ok(Chunk {
            number,
            rows: rows.collect::<Result<_, _>>()?,
        })
    }

    /// What is driven side by side; `None` for a drive that is rejected.
    fn run_batched(&self, first: u64, scenarios: &[Scenario]) -> Result<Vec<Option<Driven>>, InputError> {
        let mut peaks: Vec<Option<Option<f64>>> = vec![Some(None); scenarios.len()];
        // First the same drives without their failures, where a metric asks for them.
        let (mut places, mut nominals) = (Vec::new(), Vec::new());
        for (place, scenario) in scenarios.iter().enumerate() {
            if self.recovers_from(scenario).is_some() {
                let failure = Failure {
                    kind: FailureKind::None,
                    ..scenario.failure()
                };
                let nominal = scenario.to_builder().failure(failure).build();
                nominals.push(nominal.map_err(|e| InputError::new(&self.name, e))?);
                places.push(place);
            }
        }
        let found = self.run_batch(first, &nominals, |number, run| {
            let scenario = &scenarios[places[number]];
            nominal_peak_m(run, self.window_of(scenario), scenario.failure().time_s)
        })?;
        for (place, peak_m) in places.into_iter().zip(found) {
            peaks[place] = peak_m;
        }
        let rows = self.run_batch(first, scenarios, |number, run| {
            peaks[number].map(|peak_m| self.measured(&scenarios[number], run, peak_m))
        })?;
        Ok(rows.into_iter().map(Option::flatten).collect())
    }

    /// What `measure` makes of what is driven side by side; nothing of what is rejected.
    fn run_batch<T>(
        &self,
        first: u64,
        scenarios: &[Scenario],
        measure: impl Fn(usize, &Run) -> T,
    ) -> Result<Vec<Option<T>>, InputError> {
        let group = Group {
            scenarios,
            first,
            checked: Checked::new(self.seed, self.drives()),
        };
        let found = group.measured(Options::default(), simulate, |place, run| Ok(measure(place, run)));
        found.map_err(|e| InputError::new(&self.name, e))
    }
}

#[cfg(test)]
mod tests {
    use crate::sweep::tests::with_road;
    use crate::sweep::{Chunk, Sweep};

    /// Holds each chunk's bytes side by side to those one by one; how many drives can be vectorised, and how many not.
    fn same_bytes(sweep: &Sweep) -> (usize, usize) {
        let (mut batched, mut out) = (0, 0);
        for chunk in 0..sweep.chunks() {
            let side_by_side = sweep.run_chunk(chunk).unwrap();
            let alone = Chunk {
                number: chunk,
                rows: sweep
                    .drives_of(chunk)
                    .map(|drive| sweep.drive(&sweep.point(drive)).unwrap())
                    .collect(),
            };
            assert_eq!(side_by_side.to_bytes(1), alone.to_bytes(1), "chunk {chunk}");
            for drive in sweep.drives_of(chunk) {
                let scenario = sweep.scenario(&sweep.point(drive)).unwrap();
                match haptic_vectorised::unsupported_reason(&scenario) {
                    None => batched += 1,
                    Some(_) => out += 1,
                }
            }
        }
        (batched, out)
    }

    /// What is driven side by side and what is rejected are the same bytes as the shipping ECU's.
    #[test]
    fn the_table_does_not_depend_on_vectorised_runs() {
        let sweep = with_road(
            "samples = 12\nmetrics = [\"time_to_recover_s\", \"sdlp_m\", \"peak_driver_torque_nm\", \"limited_time_share\"]\n",
            "[vary]\nfailure.kind = [\"none\", \"torque\", \"input\"]\nsensors = [\"paper\", \"exact\"]\n\
             \"failure.time_s\" = { uniform = [1.5, 9] }\nspeed_m_per_s = { uniform = [11, 25] }\n\
             \"driver.t_p_s\" = { uniform = [0.05, 0.5] }\n\"driver.k_hg\" = { uniform = [0, 1] }\n\
             \"driver.remnant_sd_nm\" = [0, 0.1]\n",
        );
        let (batched, out) = same_bytes(&sweep);
        assert!(batched > 40 && out > 40, "{batched} side by side, {out} not");
    }

    /// A probe, sensors with errors, other cars, wind and friction side by side.
    #[test]
    fn nor_does_it_where_the_world_is_not_the_papers() {
        let sweep = with_road(
            "samples = 24\nmetrics = [\"sdlp_m\", \"peak_driver_torque_nm\", \"limited_time_share\"]\n",
            "[vary]\nfailure.kind = [\"none\", \"input\"]\n\"failure.time_s\" = { uniform = [3, 9] }\n\
             speed_m_per_s = { uniform = [11, 25] }\n\"driver.remnant_sd_nm\" = [0, 0.1]\n\"guidance.probe\" = [false, true]\n\
             \"tolerances.load_kg\" = { uniform = [0, 300] }\n\"sensor_errors.lane_noise_m\" = [0, 0.01]\n\
             \"world.gust_sd_n\" = { uniform = [0, 150] }\n\"world.friction_nm\" = { uniform = [0, 0.4] }\n",
        );
        let (batched, out) = same_bytes(&sweep);
        assert!(batched > 0 && out == 0, "{batched} side by side, {out} not");
    }
}
