//! Guidance that adapts to a driver who adapts to it: slopes, equilibria and swings of the two together.
//!
//! A driver's trust moves K_hg with the guidance (`haptic_sim::drivers`, habit *trust*); a law moves K_1 with K_hg as the ECU estimates it.
//! Both are measured in drives behind the shipping ECU:
//!
//! - the *driver's map*: where K_hg settles at a fixed K_1, begun from a low and from a high K_hg;
//! - the *law's map*: where K_1 settles at a K_hg that is held;
//! - the *closed loop*: both free, the torque lost for a few seconds in mid-drive.
//!
//! If the product of the largest slopes of both maps is below 1 ([`SMALL_GAIN`] asks for half of that), the loop has one equilibrium and
//! returns to it, whatever the rates and delays are (the small-gain theorem for static maps with lags and delays). [`swings`] says at which
//! negative product a linear loop of lags and a delay begins to swing.
//!
//! Not here: the laws and the drivers (`haptic_sim`), what is drawn.

mod drive;
mod file;
mod linear;
#[cfg(test)]
mod tests;

use std::path::Path;

use haptic_sim::Scenario;
use haptic_sim::drivers::AnyDriver;
use haptic_sim::input::InputError;
use haptic_sim::laws::Law;
use serde::Serialize;

use crate::engine::{StudyError, Watch, each};
use crate::files::Source;
use crate::parts::{Chosen, Kinds};
use crate::statistics::{Confidence, Mean, extent, mean};
pub use drive::Seen;
use drive::{Driven, Job, What};
pub use linear::{Swing, of_series, steepest, swings};

/// Small gain with a margin of two: the largest product of slopes that a law may have with a driver.
pub const SMALL_GAIN: f64 = 0.5;
/// A gain that moves by less does not swing: noise of the estimate moves it so far, N.m.
const SWINGS_NM: f64 = 0.02;
/// Equilibria that lie further apart are two.
const APART: f64 = 0.1;

/// The instant at which the torque is lost, for how long, and how long a map's drive settles and is averaged over.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Times {
    /// When the torque is lost, s.
    pub lost_at_s: f64,
    /// For how long, s.
    pub lost_for_s: f64,
    /// How long a drive of a map settles, and the loop behind the loss, s.
    pub settles_s: f64,
    /// Over which means are taken, s.
    pub averages_s: f64,
}

impl Times {
    fn map_s(&self) -> f64 {
        self.settles_s + self.averages_s
    }

    /// How long a drive of the closed loop is, s.
    pub fn loop_s(&self) -> f64 {
        self.lost_at_s + self.lost_for_s + self.map_s()
    }
}

/// A study, checked.
pub struct Adaptation<'k> {
    /// Its name.
    pub name: String,
    seed: u64,
    seeds: u32,
    place: (String, f64, Scenario),
    /// Fixed gains of the driver's map, rising, N.m.
    k_1: Vec<f64>,
    /// Held K_hg of the law's map, rising; the first and the last begin the driver's map.
    k_hg: Vec<f64>,
    times: Times,
    laws: Vec<Chosen<'k, dyn Law>>,
    drivers: Vec<Chosen<'k, dyn AnyDriver>>,
    /// The paper's law, for the driver's map.
    fixed: Chosen<'k, dyn Law>,
    /// How often intervals hold what they are of.
    pub level: Confidence,
}

/// The driver's map at one fixed gain.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DriverPoint {
    /// The gain, N.m.
    pub k_1: f64,
    /// Where K_hg settles, begun from below and from above; none if a drive left the road.
    pub k_hg: [Option<Mean>; 2],
}

/// The law's map at one held K_hg.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LawPoint {
    /// What was held.
    pub k_hg: f64,
    /// Where K_1 settles, N.m.
    pub k_1: Option<Mean>,
}

/// A law with a driver.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Pair {
    /// Place of the law.
    pub law: usize,
    /// Place of the driver.
    pub driver: usize,
    /// The law's map.
    pub map: Vec<LawPoint>,
    /// The largest slope of the law's map, N.m.
    pub law_slope: Mean,
    /// The largest slope of the driver's map at gains that the law's map has, 1/(N.m); none where the driver has two equilibria there.
    pub driver_slope: Option<Mean>,
    /// The product of both slopes.
    pub product: Option<Mean>,
    /// K_hg before the loss, and settled behind it.
    pub k_hg: [Option<Mean>; 2],
    /// K_hg behind the loss, less that under the first law.
    pub against_first: Option<Mean>,
    /// Deviation of K_1 before the loss, N.m.
    pub swing_nm: Option<Mean>,
    /// How long a swing lasts, s; none if K_1 did not swing twice, or by less than 0.02 N.m.
    pub period_s: Option<f64>,
    /// Drives that left the road or in which the ECU ended guidance by itself, of all of this law with this driver.
    pub ended: u32,
    /// K_hg and K_1 of the first seed each second.
    #[serde(skip)]
    pub series: Vec<Seen>,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AdaptationResults {
    /// Its name.
    pub name: String,
    /// Road and speed, km/h.
    pub place: (String, f64),
    /// Drives of each kind.
    pub seeds: u32,
    /// How often intervals hold what they are of.
    #[serde(skip_serializing_if = "Confidence::is_usual")]
    pub level: Confidence,
    /// When the torque is lost, for how long, settling and averaging times, s.
    pub times_s: [f64; 4],
    /// Names of the laws; the first is what the others are held against.
    pub laws: Vec<String>,
    /// Names of the drivers.
    pub drivers: Vec<String>,
    /// The map of each driver.
    pub maps: Vec<Vec<DriverPoint>>,
    /// By law, then driver.
    pub pairs: Vec<Pair>,
}

/// What the interval of a product tells of small gain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SmallGain {
    /// The product is at most [`SMALL_GAIN`].
    Holds,
    /// It is above that, and below 1.
    WithoutMargin,
    /// It is 1 at least.
    Fails,
    /// The driver has two equilibria.
    TwoEquilibria,
    /// The interval lies on both sides of a limit, or there is none.
    Untold,
}

impl Pair {
    /// What the product tells.
    pub fn small_gain(&self) -> SmallGain {
        match self.product.map(|product| (product.mean, product.interval)) {
            None => SmallGain::TwoEquilibria,
            // A gain that does not move in any drive.
            Some((0.0, None)) => SmallGain::Holds,
            Some((_, Some([_, high]))) if high <= SMALL_GAIN => SmallGain::Holds,
            Some((_, Some([low, _]))) if low >= 1.0 => SmallGain::Fails,
            Some((_, Some([low, high]))) if low > SMALL_GAIN && high < 1.0 => SmallGain::WithoutMargin,
            Some(_) => SmallGain::Untold,
        }
    }
}

impl AdaptationResults {
    /// K_hg and K_1 of the closed loops' first seed, a row a second.
    pub fn to_csv(&self) -> String {
        let mut text = String::from("law,driver,time_s,k_hg,k_1_nm\n");
        for pair in &self.pairs {
            let names = format!("{},{}", self.laws[pair.law], self.drivers[pair.driver]);
            for (second, Seen { k_hg, k_1 }) in pair.series.iter().enumerate() {
                text += &format!("{names},{},{k_hg:.4},{k_1:.4}\n", second + 1);
            }
        }
        text
    }
}

impl<'k> Adaptation<'k> {
    /// Whether a file has the maps of such a study, right or wrong.
    pub fn is_in(path: &Path) -> bool {
        let table = Source::open(path)
            .ok()
            .and_then(|(_, text)| text.parse::<toml::Table>().ok());
        table.is_some_and(|table| table.contains_key("map"))
    }

    /// Reads a file and checks it. The road is found beside it.
    ///
    /// # Errors
    /// The file, the field, its value and its range.
    pub fn load(path: &Path, kinds: &'k Kinds) -> Result<Self, InputError> {
        let (source, text) = Source::open(path)?;
        file::from_text(&source, &text, kinds)
    }

    /// Every drive: the drivers' maps, then the laws' maps, then the closed loops; the seeds innermost.
    fn jobs(&self) -> Vec<Job> {
        let mut drives = Vec::new();
        let ends = [self.k_hg[0], self.k_hg[self.k_hg.len() - 1]];
        for driver in 0..self.drivers.len() {
            for &k_1 in &self.k_1 {
                drives.extend(ends.map(|begins| (driver, What::Fixed { k_1, begins })));
            }
        }
        for (law, driver) in self.pairs() {
            drives.extend(self.k_hg.iter().map(|&k_hg| (driver, What::Held { law, k_hg })));
        }
        drives.extend(self.pairs().map(|(law, driver)| (driver, What::Free { law })));
        let job = |(driver, what)| (0..self.seeds).map(move |seed| Job { driver, seed, what });
        drives.into_iter().flat_map(job).collect()
    }

    fn pairs(&self) -> impl Iterator<Item = (usize, usize)> {
        let drivers = self.drivers.len();
        (0..self.laws.len() * drivers).map(move |number| (number / drivers, number % drivers))
    }

    /// Drives and sums up, on all cores.
    ///
    /// # Errors
    /// As [`haptic_sim::scenario::ScenarioBuilder::build`] for a driver's parameters.
    pub fn run(&self, watch: &Watch<'_>) -> Result<AdaptationResults, StudyError> {
        let driven = each(&self.jobs(), watch, |job| self.driven(job))?;
        let (maps, mut pairs) = self.summed(&driven, None);
        let seeds = (0..self.seeds as usize).filter(|_| self.seeds > 1);
        let left: Vec<Vec<Pair>> = seeds.map(|seed| self.summed(&driven, Some(seed)).1).collect();
        for (number, pair) in pairs.iter_mut().enumerate() {
            let told = |whole: Mean, of: fn(&Pair) -> Option<Mean>| {
                let left: Option<Vec<f64>> =
                    left.iter().map(|pairs| Some(of(&pairs[number])?.mean)).collect();
                Mean::tukey(whole.mean, &left.unwrap_or_default(), self.level)
            };
            pair.law_slope = told(pair.law_slope, |pair| Some(pair.law_slope));
            pair.driver_slope = pair
                .driver_slope
                .map(|whole| told(whole, |pair| pair.driver_slope));
            pair.product = pair.product.map(|whole| told(whole, |pair| pair.product));
        }
        Ok(self.results(maps, pairs))
    }

    /// The drivers' maps and the pairs, of all seeds or without one; slopes and products have no intervals.
    fn summed(&self, driven: &[Driven], left_out: Option<usize>) -> (Vec<Vec<DriverPoint>>, Vec<Pair>) {
        let mut groups = driven.chunks(self.seeds as usize).map(|group| -> Vec<&Driven> {
            let kept = group
                .iter()
                .enumerate()
                .filter(|(seed, _)| Some(*seed) != left_out);
            kept.map(|(_, drive)| drive).collect()
        });
        let mut next = || groups.next().unwrap_or_default();
        let window = [self.times.settles_s, self.times.map_s()];
        let mut settled = |value: fn(&Seen) -> f64, ended: &mut u32| {
            let group = next();
            *ended += group.iter().filter(|drive| drive.ended).count() as u32;
            self.mean_of(group.iter().map(|drive| drive.mean(window, value)))
        };
        let mut ignored = 0;
        let maps: Vec<Vec<DriverPoint>> = (self.drivers.iter())
            .map(|_| {
                let point = |k_1: &f64| DriverPoint {
                    k_1: *k_1,
                    k_hg: [(); 2].map(|()| settled(|seen| seen.k_hg, &mut ignored)),
                };
                self.k_1.iter().map(point).collect()
            })
            .collect();
        let law_maps: Vec<(Vec<LawPoint>, u32)> = self
            .pairs()
            .map(|_| {
                let mut ended = 0;
                let point = |held: &f64| LawPoint {
                    k_hg: *held,
                    k_1: settled(|seen| seen.k_1, &mut ended),
                };
                (self.k_hg.iter().map(point).collect(), ended)
            })
            .collect();
        let loops: Vec<Vec<&Driven>> = self.pairs().map(|_| next()).collect();
        let mut pairs = Vec::new();
        for (((law, driver), (map, ended)), own) in self.pairs().zip(law_maps).zip(&loops) {
            pairs.push(Pair {
                law,
                driver,
                ended: ended + own.iter().filter(|drive| drive.ended).count() as u32,
                ..self.pair(own, &loops[driver], &maps[driver], map)
            });
        }
        (maps, pairs)
    }

    /// A law with a driver, of the drives of their loop and of those under the first law.
    fn pair(&self, own: &[&Driven], first: &[&Driven], driver: &[DriverPoint], map: Vec<LawPoint>) -> Pair {
        let Times {
            lost_at_s,
            settles_s,
            averages_s,
            ..
        } = self.times;
        let ends_s = self.times.loop_s();
        let [before, behind] = [[lost_at_s - averages_s, lost_at_s], [ends_s - averages_s, ends_s]];
        let k_hg = |drive: &Driven, window| drive.mean(window, |seen| seen.k_hg);
        let points: Vec<(f64, f64)> = (map.iter())
            .filter_map(|point| Some((point.k_hg, point.k_1?.mean)))
            .collect();
        let law_slope = steepest(&points, [f64::NEG_INFINITY, f64::INFINITY]);
        let driver_slope = driver_slope(driver, extent(points.iter().map(|point| point.1)));
        let alone = |figure: f64| Mean::tukey(figure, &[], self.level);
        let swings: Vec<_> = (own.iter())
            .map(|drive| of_series(&drive.within([settles_s, lost_at_s], |seen| seen.k_1)))
            .collect();
        let large = swings.iter().filter(|swing| swing.deviation >= SWINGS_NM);
        Pair {
            law: 0,
            driver: 0,
            map,
            law_slope: alone(law_slope),
            driver_slope: driver_slope.map(alone),
            // A gain that does not move has no loop.
            product: match law_slope {
                0.0 => Some(alone(0.0)),
                _ => driver_slope.map(|slope| alone(slope * law_slope)),
            },
            k_hg: [before, behind].map(|window| self.mean_of(own.iter().map(|drive| k_hg(drive, window)))),
            against_first: self.mean_of(
                (own.iter().zip(first)).map(|(own, first)| Some(k_hg(own, behind)? - k_hg(first, behind)?)),
            ),
            swing_nm: self.mean_of(swings.iter().map(|swing| Some(swing.deviation))),
            period_s: mean(large.filter_map(|swing| swing.period_s)),
            ended: 0,
            series: own.first().map_or_else(Vec::new, |drive| drive.series.clone()),
        }
    }

    fn mean_of(&self, values: impl Iterator<Item = Option<f64>>) -> Option<Mean> {
        Mean::new(&values.collect::<Option<Vec<f64>>>()?, self.level)
    }

    fn results(&self, maps: Vec<Vec<DriverPoint>>, pairs: Vec<Pair>) -> AdaptationResults {
        let Times {
            lost_at_s,
            lost_for_s,
            settles_s,
            averages_s,
        } = self.times;
        AdaptationResults {
            name: self.name.clone(),
            place: (self.place.0.clone(), self.place.1),
            seeds: self.seeds,
            level: self.level,
            times_s: [lost_at_s, lost_for_s, settles_s, averages_s],
            laws: self.laws.iter().map(|law| law.name.clone()).collect(),
            drivers: self.drivers.iter().map(|driver| driver.name.clone()).collect(),
            maps,
            pairs,
        }
    }
}

/// The largest slope of a driver's map over a stretch of gains; none where it has two equilibria.
fn driver_slope(map: &[DriverPoint], reach: [f64; 2]) -> Option<f64> {
    let branch = |end: usize| -> Vec<(f64, f64)> {
        (map.iter())
            .filter_map(|point| Some((point.k_1, point.k_hg[end]?.mean)))
            .collect()
    };
    let inside = |point: &&DriverPoint| (reach[0]..=reach[1]).contains(&point.k_1);
    let apart = |point: &DriverPoint| match point.k_hg {
        [Some(low), Some(high)] => (high.mean - low.mean).abs() > APART,
        // Off the road.
        _ => true,
    };
    let two = map.iter().filter(inside).any(apart);
    (!two).then(|| steepest(&branch(0), reach).max(steepest(&branch(1), reach)))
}
