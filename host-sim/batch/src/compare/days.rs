//! Drivers who adapt over days to the share of guidance that they get.
//!
//! Each day is a drive on one of the judged roads, with noise of its own. The share of a day is the mean size of the guidance torque over that
//! under the published law with the gains of table 6: 1 is what table 6 was measured with, 0 is table 5. Beyond 1 nothing is published, so
//! that more counts as 1. The driver's own share follows it with his time constant.

use std::f64::consts::E;

use haptic_metrics::without_probe;
use haptic_sim::laws::{Gains, Law};
use serde::Serialize;

use super::{Compare, Set, StudyError, Watch, each, pairs};
use crate::engine::{drive_forked, trunk};
use crate::places::{Drives, seed_of};
use crate::record::probe_hz;
use crate::statistics::mean;

/// Where a driver stands behind his days.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Adapted {
    /// Place of the law.
    pub law: usize,
    /// Place of the driver.
    pub driver: usize,
    /// Place of the world.
    pub world: usize,
    /// 0 with his manual gains, 1 with his guided ones.
    pub share: f64,
}

/// A law with values, a driver and a world.
type Life<'s> = (&'s Set, usize, usize);

impl Compare<'_> {
    /// Where the drivers stand behind the days of each world, by set, then driver, then world; none of one who does not adapt, who has no
    /// days, or who drives by hand.
    pub(super) fn behind_days(
        &self,
        sets: &[Set],
        watch: &Watch<'_>,
    ) -> Result<Vec<Option<Adapted>>, StudyError> {
        let worlds = 0..self.worlds.len();
        let lives: Vec<Life<'_>> = pairs(sets)
            .flat_map(|(set, driver)| worlds.clone().map(move |world| (set, driver, world)))
            .collect();
        let adapts = |(set, driver, world): &Life<'_>| {
            let adapts = self.days[*world] > 0 && self.drivers[*driver].adapts().is_some();
            adapts && !self.is_none(set.law)
        };
        let lived: Vec<Life<'_>> = lives.iter().copied().filter(adapts).collect();
        let mut whole: Vec<(usize, usize)> =
            lived.iter().map(|(_, driver, world)| (*driver, *world)).collect();
        whole.sort_unstable();
        whole.dedup();
        let days = |world: usize| 0..self.days[world];
        let published = each(&whole, watch, |&(driver, world)| {
            let day = |day| self.felt_nm(Box::new(Gains::PAPER), driver, 1.0, (world, day));
            days(world).map(day).collect::<Result<Vec<f64>, _>>()
        })?;
        let mut shares = each(&lived, watch, |(set, driver, world)| {
            let place = whole.binary_search(&(*driver, *world));
            let whole_nm = &published[place.expect("it was driven above")];
            let [begins, lasts_days] = self.drivers[*driver].adapts().expect("he was chosen above");
            let follows = 1.0 - E.powf(-1.0 / lasts_days);
            let mut share = begins;
            for day in days(*world) {
                let law = self.laws[set.law].make(&self.judged.places[0].2, &set.values)?;
                let felt_nm = self.felt_nm(law, *driver, share, (*world, day))?;
                share += follows * ((felt_nm / whole_nm[day as usize]).min(1.0) - share);
            }
            Ok(share)
        })?
        .into_iter();
        let of_life = |life: &Life<'_>| {
            let (law, driver, world) = (life.0.law, life.1, life.2);
            let share = adapts(life).then(|| shares.next())??;
            Some(Adapted {
                law,
                driver,
                world,
                share,
            })
        };
        Ok(lives.iter().map(of_life).collect())
    }

    /// The mean size of the guidance torque of a day, N.m, without the probe.
    fn felt_nm(
        &self,
        law: Box<dyn Law>,
        driver: usize,
        share: f64,
        (world, day): (usize, u32),
    ) -> Result<f64, StudyError> {
        let Drives { places, .. } = &self.judged;
        let in_world = places.len() / self.worlds.len();
        let (road, speed_kmh, scenario) = &places[world * in_world + day as usize % in_world];
        let seed = seed_of(self.seed, "days", road, *speed_kmh, day);
        let scenario = scenario.to_builder().seed(seed).build()?;
        let driver = self.drivers[driver].with_share(&scenario, share)?;
        let (run, _) = drive_forked(trunk(&scenario, law, driver), &[], 0.0, |_, _| ());
        let torque_nm = without_probe(&run.trace, probe_hz(&scenario), |sample| {
            sample.guidance_torque_nm
        });
        Ok(mean(torque_nm.into_iter().map(f64::abs)).unwrap_or(0.0))
    }
}
