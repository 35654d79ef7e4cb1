//! A lane preview that fails: for a second guidance goes on without it, by the shipping core's own arithmetic.
//!
//! Where the lane goes on to depends on the last second of pictures and yaw rates alone. So a run whose preview fails watches
//! them from a little before, one by one; the torque then has the share and the bounds of `haptic-core`'s `coast`.

use haptic_core::controller::config::Config;
use haptic_core::lane::LaneSample;
use haptic_core::quantity::{Instant, Metres, Micros, Radians, Speed, TurningRate};
use haptic_core::safety::coast;
use haptic_core::safety::motion_history::MotionHistory;
use haptic_core::safety::plausibility::PlausibilityState;

use super::counts::{MS, ONE, bits, ms, on_the_bus, per_second, small_bits, truncated};

/// Without a picture guidance goes on for so long, ms, by so much at a time.
pub(super) const BLIND_MS: u32 = ms(coast::MOST_BLIND);
pub(super) const GOES_ON_MS: u32 = ms(coast::EXTRAPOLATION_PERIOD);
/// How long before the failure it is watched, ms: all that the past keeps, in whole periods of what it keeps of a camera.
const WATCHED_MS: u32 = 1200;
const KEPT_MS: u32 = 25;
/// How fast trust falls, in a second.
const FALL: i32 = bits(coast::BLIND_FALL.si());

/// A run whose preview fails.
pub(super) struct Coast {
    config: Config,
    state: PlausibilityState,
    motion_history: MotionHistory,
    from: u32,
    /// The step of the time-out.
    lost: u32,
    heard: u32,
    /// What came of the vehicle in this step.
    came: Option<[f64; 2]>,
    last: LaneSample,
    /// The torque that the law demanded then.
    pub(super) demanded: i32,
}

impl Coast {
    pub(super) fn new(config: Config, failure_step: u32, lost: u32) -> Self {
        Self {
            config,
            state: PlausibilityState::NEW,
            motion_history: MotionHistory::new(),
            from: failure_step.saturating_sub(WATCHED_MS) / KEPT_MS * KEPT_MS,
            lost,
            heard: 0,
            came: None,
            last: LaneSample::default(),
            demanded: 0,
        }
    }

    /// Whether a step is watched.
    pub(super) fn watches(&self, step: u32) -> bool {
        (self.from..self.lost + BLIND_MS).contains(&step)
    }

    /// A message of the vehicle: speed, and yaw rate before the bus rounds it. The shipping core lets the lane go on before it
    /// takes one.
    pub(super) fn vehicle(&mut self, step: u32, came: [f64; 2]) {
        if self.lost_ms(step).is_some() {
            self.came = Some(came);
        } else {
            self.turn(step, came);
        }
    }

    fn turn(&mut self, step: u32, [v_m_per_s, yaw_rate_rad_per_s]: [f64; 2]) {
        let counts = on_the_bus(small_bits(yaw_rate_rad_per_s), 12);
        let rate = TurningRate::from_rad_per_s(f64::from(counts) / ONE);
        let checks = &self.config.plausibility;
        checks.motion(&mut self.state, Speed::from_m_per_s(v_m_per_s), Some(rate));
        self.motion_history.record_turning_rate(at(step), rate);
    }

    /// A picture, in counts.
    pub(super) fn picture(&mut self, step: u32, [e_y, e_theta]: [i32; 2]) {
        self.take(
            step,
            LaneSample {
                e_y: Metres::from_m(f64::from(e_y) / ONE),
                e_theta: Radians::from_rad(f64::from(e_theta) / ONE),
                at: at(step),
            },
        );
    }

    fn take(&mut self, step: u32, sample: LaneSample) {
        self.motion_history
            .record_line(at(step), sample.at, sample.e_theta);
        (self.heard, self.last) = (step, sample);
    }

    /// For how many steps, this one included, guidance has gone on without pictures.
    pub(super) fn lost_ms(&self, step: u32) -> Option<u32> {
        (self.lost..self.lost + BLIND_MS)
            .contains(&step)
            .then(|| step - self.lost + 1)
    }

    /// Where the lane went on to in this step, in counts, and how long that took, ms.
    pub(super) fn extrapolate(&mut self, step: u32) -> Option<([i32; 2], u32)> {
        let passed = step - self.heard;
        let extrapolated_lane = (passed >= GOES_ON_MS).then(|| {
            let checks = &self.config.plausibility;
            let sample =
                checks.extrapolated_lane(&self.state, &self.motion_history, at(step), &self.last, at(step));
            self.take(step, sample);
            let counts = [
                truncated(sample.e_y.m() * ONE),
                truncated(sample.e_theta.rad() * ONE),
            ];
            (counts, passed)
        });
        if let Some(came) = self.came.take() {
            self.turn(step, came);
        }
        extrapolated_lane
    }

    /// What is left of what the law asks for, and of the share that acts.
    pub(super) fn left(&self, lost_ms: u32, demanded: i32, share: i32) -> (i32, i32) {
        let away = lost_ms as i32 * 1000 * bits(coast::AWAY_PER_US.nm());
        let demanded = demanded
            .max(self.demanded.saturating_sub(away))
            .min(self.demanded.saturating_add(away));
        let trust = (1 << 24) + lost_ms as i32 * per_second(FALL, MS);
        (demanded, share_of(share, trust))
    }
}

/// A share of a share, as core rounds it.
fn share_of(share: i32, of: i32) -> i32 {
    ((i64::from(share) * i64::from(of) + (1 << 23)) >> 24) as i32
}

/// The ECU's clock at a step.
fn at(step: u32) -> Instant {
    Instant::from_us(0).after(Micros::from_ms(step))
}
