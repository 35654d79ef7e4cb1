//! The independent monitor. It alone gives the permission to apply the torque, renews it every millisecond, and
//! withdraws it for good when a command breaks one of its rules.
//!
//! It is a second, simpler computation in plain `i32` milli-newton-metres. It decodes the bytes of the frames that
//! arrive and leave by itself, has its own limits, and uses nothing of the law, the envelope or the bus module, so
//! that a mistake there is not repeated here. It shares only the way in which memory is kept twice.
//!
//! What it refuses: a torque beyond the limit, growing too fast (in Fade and Handover at all), falling too fast (in Handover
//! four times as fast as elsewhere; with a bar at 64 mN.m in a millisecond; unless the mode says that it ends at once, or the driver overrides), in a mode without
//! torque, against a driver who overrides, on lane data that is too old, or, in Active, away from the torque that lane errors
//! ask for. Across zero all of the new torque has grown. The last rule is coarse (proportional part and rates over 50 ms, 0.3
//! N.m of tolerance) and may be crossed for 20 ms, in which a falling torque does not count: the envelope may still be bringing
//! an honest change about. While the host asks for the probe, and for a second after, the band is wider by the probe's
//! amplitude.
//!
//! Each rule can be tried by itself: [`Monitor::self_test_vector`]. One long file, so that all that a permission depends on is read in one
//! place.

use crate::safety::redundant::words;

words! {
    /// Limits in mN.m and per unit; immutable.
    pub struct Monitor {
        /// L.
        pub(crate) limit_mnm: i32,
        /// Largest growth in one millisecond.
        pub(crate) growth_mnm_per_ms: i32,
        /// Largest fall in one millisecond.
        pub(crate) fall_mnm_per_ms: i32,
        /// In Handover.
        pub(crate) handover_fall_mnm_per_ms: i32,
        /// Half the band around the torque that the lane errors ask for.
        pub(crate) band_mnm: i32,
        /// Amplitude of the probe.
        pub(crate) probe_mnm: i32,
        /// Equation (9), mN.m per m, per rad, per m/s, per rad/s.
        pub(crate) gains_mnm: [i32; 4],
        /// How long a driver's torque has to last until guidance has to yield to it, and how far it may be beyond the hands'. With a bar
        /// both are above zero, as it shows the wheel's inertia and friction too and the controller knows the hands later; a sensor of
        /// the hands' torque needs neither.
        pub(crate) window_us: i32,
        pub(crate) margin_mnm: i32,
        /// Inertia of the wheel on its bar, divided by the square of [`LAG_MS`], mN.m per mrad; 0 without a bar.
        pub(crate) wheel_mnm_per_mrad: i32,
    }
}

words! {
    /// What the monitor remembers: the part that most steps change, the part that a picture changes, and the part that a column with a
    /// torsion bar changes.
    pub struct MonitorState {
        pub(crate) step: StepState,
        pub(crate) lane_state: LaneState,
        pub(crate) wheel: WheelState,
    }
}

words! {
    /// The part that most steps change.
    pub(crate) struct StepState {
        torque_mnm: i32,
        /// Least and largest driver torque of the window that goes on, and of the one before it.
        driver_mnm: [[i32; 2]; 2],
        /// Since when it goes on.
        window_us: i32,
        /// Time since the lane sample in use was taken.
        age_us: i32,
        /// Time since a picture came, in use or not.
        unheard_us: i32,
        /// For how long pictures may still be left aside.
        aside_us: i32,
        /// How long the torque may still contain the probe.
        probe_left_us: i32,
        /// Number of steps in which the torque was outside its band and not falling, since it was last inside.
        astray_ms: i32,
        /// 1 after the first disagreement.
        withdrawn: i32,
    }
}

words! {
    /// The part that a new picture changes.
    pub(crate) struct LaneState {
        lane: Lane,
        /// How far apart the last two pictures came, and the longest such time of a camera that sends, lately.
        apart_us: i32,
        period_us: i32,
        /// An older lane sample, from which the rates are computed, and how much older it is.
        before: Lane,
        older_us: i32,
        /// What its position asks for, and what its rates ask for beside.
        position_mnm: i32,
        rate_mnm: i32,
    }
}

words! {
    /// The part that a column with a torsion bar changes.
    pub(crate) struct WheelState {
        /// How old the window of driver torques was when the column was last heard.
        heard_us: i32,
        /// Its angle behind one lag of [`LAG_MS`], and behind two.
        lagged_urad: [i32; 2],
    }
}

words! {
    /// Lane errors as the monitor reads them.
    struct Lane {
        e_y_mm: i32,
        e_theta_urad: i32,
    }
}

/// Bytes of the newest frames in use, and which came since the last step. Not kept twice: a flipped bit lasts until the next frame, for
/// less than the time for which a torque may be astray.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frames {
    /// Lane preview.
    pub lane: [u8; 8],
    /// Column.
    pub column: [u8; 8],
    /// Request.
    pub request: [u8; 8],
    /// Which of them are new.
    pub new: New,
}

/// Which frames are new.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct New {
    /// Lane preview.
    pub lane: bool,
    /// Column.
    pub column: bool,
    /// Request.
    pub request: bool,
}

impl Frames {
    /// None came.
    pub const NONE: Self = Self {
        lane: [0; 8],
        column: [0; 8],
        request: [0; 8],
        new: New {
            lane: false,
            column: false,
            request: false,
        },
    };
}

/// What the monitor is shown every millisecond.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Evidence<'a> {
    /// Frames that arrived.
    pub frames: &'a Frames,
    /// Bytes of the guidance frame about to leave.
    pub guidance: &'a [u8; 8],
    /// Time since the last step, us.
    pub elapsed_us: u32,
}

/// Modes as the frame codes them; the last with torque is Handover.
const STANDBY: i32 = 1;
const ACTIVE: i32 = 2;
const FADE: i32 = 3;
const HANDOVER: i32 = 4;
const LAST_WITH_TORQUE: i32 = HANDOVER;
/// Half an LSB on each side, and the roundings of this file.
const TOLERANCE_MNM: i32 = 3;
/// How many times as fast a torque may fall in a handover. The lane may be implausible then, which the monitor does
/// not know.
pub(crate) const DISTRUSTED: i32 = 4;
/// How fast a torque may fall with a bar, as it yields to hands that the bar shows later, if at all: a wheel that they throw takes up all
/// that they do.
pub(crate) const YIELD_MNM_PER_MS: i32 = 64;
/// A probe ends within one of its periods, which is 1 s at most; a request is out of date after 75 ms, three periods of the slowest
/// host.
const PROBE_END_US: i32 = 1_075_000;
/// The acceleration of a wheel on a bar is taken from its angle through two lags of this time: one step of 0.1 deg reads as 5 rad/s2
/// at most.
pub(crate) const LAG_MS: i32 = 20;
/// One count of an angle in the column's frame, 0.01 deg.
const ANGLE_URAD: i32 = 175;
/// How many steps the torque may be outside its band.
pub const ASTRAY_MS: i32 = 20;
/// In Active no torque may follow from lane data older than this: the age of a sample on arrival, and three periods
/// of the slowest camera.
const OLDEST_LANE_US: i32 = 360_000;
/// How much longer the lane may be extrapolated: a second without a picture, and 0.4 s in which the torque falls
/// where pictures then show another line. The band is wider by 1 mN.m for each millisecond since the last picture.
const COAST_US: i32 = 1_400_000;
/// A camera is silent after this time without a picture, and after two and a half of its periods: both are shorter than any time-out
/// of the controller, which waits for three periods and 30 ms. One lost picture is no silence.
const SILENT_US: i32 = 25_000;
/// The period of the slowest camera that is waited for, 15 Hz. A shorter one is forgotten within 64 pictures.
const LONGEST_PERIOD_US: i32 = 66_667;
/// Behind a silence pictures may show another line, and be left aside for so long: after 0.5 s an honest controller has let go of the
/// old line, and has no torque.
const ASIDE_US: i32 = 600_000;
/// A sample older than this is continued with its rates, for at most the second time.
const PROMPT_LANE_US: i32 = 40_000;
const LONGEST_LATE_US: i32 = OLDEST_LANE_US - PROMPT_LANE_US;
/// The override bound: it begins at 0.8 N.m of opposing torque and falls by 3 N.m per N.m. The slack covers what can
/// change in the time of two frames.
const OVERRIDE_FROM_MNM: i32 = 800;
const OVERRIDE_SLOPE: i32 = 3;
const OVERRIDE_SLACK_MNM: i32 = 50;
/// The number of rules, each of which has a self-test.
pub const RULES: u32 = 7;
/// Rates are taken over at least this.
pub const RATE_SPAN_US: i32 = 50_000;

impl MonitorState {
    /// Nothing seen, permission granted.
    pub const NEW: Self = Self {
        step: StepState {
            torque_mnm: 0,
            driver_mnm: [[0; 2]; 2],
            window_us: 0,
            age_us: 0,
            unheard_us: 0,
            aside_us: 0,
            probe_left_us: 0,
            astray_ms: 0,
            withdrawn: 0,
        },
        lane_state: LaneState {
            lane: Lane {
                e_y_mm: 0,
                e_theta_urad: 0,
            },
            apart_us: 0,
            period_us: 0,
            before: Lane {
                e_y_mm: 0,
                e_theta_urad: 0,
            },
            older_us: 0,
            position_mnm: 0,
            rate_mnm: 0,
        },
        wheel: WheelState {
            heard_us: 0,
            lagged_urad: [0; 2],
        },
    };
}

impl Monitor {
    /// Judges what is about to leave. `true` renews the permission for this millisecond; after the first
    /// `false` it is never renewed.
    #[must_use]
    #[inline(always)]
    pub fn step(&self, state: &mut MonitorState, evidence: &Evidence<'_>) -> bool {
        let elapsed_us = i32::try_from(evidence.elapsed_us)
            .unwrap_or(i32::MAX)
            .min(1_000_000);
        if state.observe(evidence, elapsed_us, self) {
            self.update_demand(state);
        }
        let torque = field(evidence.guidance, 12, 16).saturating_mul(1000) / 4096;
        let mode = field(evidence.guidance, 32, 4);
        let changes_sign = (torque ^ state.step.torque_mnm).is_negative();
        let old = if changes_sign { 0 } else { state.step.torque_mnm };
        let grown = torque.saturating_abs().saturating_sub(old.saturating_abs());
        let within = |per_ms: i32| {
            let so_long = if elapsed_us <= 1000 {
                per_ms
            } else {
                per_ms.saturating_mul(elapsed_us.min(2000)).saturating_div(1000)
            };
            so_long.saturating_add(TOLERANCE_MNM)
        };
        let allowed = if mode == ACTIVE {
            within(self.growth_mnm_per_ms)
        } else {
            0
        };
        let left = if changes_sign { 0 } else { torque.saturating_abs() };
        let driver = self.at_least(state);
        let fallen = state.step.torque_mnm.saturating_abs().saturating_sub(left);
        let fall_mnm_per_ms = if mode == HANDOVER {
            self.handover_fall_mnm_per_ms
        } else {
            self.fall_mnm_per_ms
        };
        let may_fall = fallen <= within(fall_mnm_per_ms)
            || mode > LAST_WITH_TORQUE
            || left.saturating_add(OVERRIDE_SLACK_MNM) >= self.bound(state.step.torque_mnm, driver);
        let agrees = torque.saturating_abs() <= self.limit_mnm.saturating_add(TOLERANCE_MNM)
            && grown <= allowed
            && may_fall
            && (torque == 0 || (ACTIVE..=LAST_WITH_TORQUE).contains(&mode))
            && self.leaves_the_driver_in_charge(torque, driver)
            && (mode != ACTIVE || self.follows_the_lane(state, torque));
        state.step.torque_mnm = torque;
        state.step.withdrawn |= i32::from(!agrees);
        state.step.withdrawn == 0
    }

    /// The monitor of a simulator's ECU with another law than (9): the band around (9) is as wide as the absolute limit, and
    /// so refuses nothing that the limit does not. The other rules are the product's.
    #[cfg(feature = "another-law")]
    #[must_use]
    pub const fn with_another_law(self) -> Self {
        Self {
            band_mnm: self.limit_mnm,
            ..self
        }
    }

    /// What a hand has certainly done, for all that the readings of the last one or two windows say.
    fn at_least(&self, state: &MonitorState) -> i32 {
        let [low, high] = state.driver_range();
        let low = low.saturating_sub(self.margin_mnm).max(0);
        low.saturating_add(high.saturating_add(self.margin_mnm).min(0))
    }

    /// `abs(T) <= L + 3*(0.8 - opposing)`.
    fn leaves_the_driver_in_charge(&self, torque: i32, driver: i32) -> bool {
        let bound = self.bound(torque, driver);
        torque.saturating_abs() <= bound.saturating_add(OVERRIDE_SLACK_MNM)
    }

    /// The largest torque that the driver's torque allows on the side of `torque`.
    fn bound(&self, torque: i32, driver: i32) -> i32 {
        let opposing = if torque.is_negative() {
            driver
        } else {
            driver.saturating_neg()
        };
        let beyond = opposing.saturating_sub(OVERRIDE_FROM_MNM);
        // The usual case first: nobody opposes.
        if beyond <= 0 {
            return self.limit_mnm.max(0);
        }
        let shrink = beyond.saturating_mul(OVERRIDE_SLOPE);
        self.limit_mnm.saturating_sub(shrink).max(0)
    }

    /// What a new lane sample asks for.
    fn update_demand(&self, state: &mut MonitorState) {
        let [per_m, per_rad, per_mps, per_radps] = self.gains_mnm;
        let (e_y_mmps, e_theta_urps) = state.rates();
        let demanded = |per_length: i32, length: i32, per_angle: i32, angle: i32| {
            per_length
                .saturating_mul(length)
                .saturating_div(1000)
                .saturating_add(per_angle.saturating_mul(angle / 100) / 10_000)
        };
        state.lane_state.position_mnm = demanded(
            per_m,
            state.lane_state.lane.e_y_mm,
            per_rad,
            state.lane_state.lane.e_theta_urad,
        );
        state.lane_state.rate_mnm = demanded(per_mps, e_y_mmps, per_radps, e_theta_urps);
    }

    fn follows_the_lane(&self, state: &mut MonitorState, torque: i32) -> bool {
        if state.step.age_us > OLDEST_LANE_US.saturating_add(COAST_US) && torque != 0 {
            return false;
        }
        // An old sample may still be right, or its errors may have continued with their rates for as long as a slow
        // camera waits.
        let late_us = state.step.age_us.saturating_sub(PROMPT_LANE_US);
        let (position, rate) = (state.lane_state.position_mnm, state.lane_state.rate_mnm);
        let both = position.saturating_add(rate);
        // Limits, ramps and the authority can only make the torque smaller: zero is always in the band.
        let (mut low, mut high) = (position.min(both).min(0), position.max(both).max(0));
        if late_us >= 1000 {
            let late_ms = late_us.min(LONGEST_LATE_US) / 1000;
            let [per_m, per_rad, ..] = self.gains_mnm;
            let (e_y_mmps, e_theta_urps) = state.rates();
            let carried = per_m
                .saturating_mul(e_y_mmps.saturating_mul(late_ms) / 1000)
                .saturating_div(1000)
                .saturating_add(
                    per_rad.saturating_mul((e_theta_urps / 1000).saturating_mul(late_ms) / 100) / 10_000,
                );
            let position = position.saturating_add(carried);
            let both = position.saturating_add(rate);
            (low, high) = (low.min(position).min(both), high.max(position).max(both));
        }
        let probe = if state.step.probe_left_us > 0 {
            self.probe_mnm
        } else {
            0
        };
        let band = self
            .band_mnm
            .saturating_add(probe)
            .saturating_add(late_us.max(0) / 1000);
        let (low, high) = (low.saturating_sub(band), high.saturating_add(band));
        let falling = torque.saturating_abs() < state.step.torque_mnm.saturating_abs();
        if (low..=high).contains(&torque) {
            state.step.astray_ms = 0;
        } else if !falling {
            state.step.astray_ms = state.step.astray_ms.saturating_add(1);
        }
        state.step.astray_ms <= ASTRAY_MS
    }

    /// A self-test: a state and a guidance frame 1 ms later, without other frames, that exactly one rule refuses.
    /// Each of [`RULES`] turns tests another rule. (If the limit is less than 0.1 N.m above the band, no torque can
    /// be outside the band only, and the limit refuses that turn.)
    #[must_use]
    pub fn self_test_vector(&self, turn: u32) -> (MonitorState, [u8; 8]) {
        // Unless a turn changes it: a constant torque that every rule allows.
        let (mut torque, mut grown, mut mode, mut state) = (100, 0, ACTIVE, MonitorState::NEW);
        match turn % RULES {
            0 => (torque, mode) = (self.limit_mnm.saturating_add(20), FADE),
            1 => grown = torque,
            2 => mode = STANDBY,
            3 => state.step.driver_mnm = [[-20_000; 2]; 2],
            4 => state.step.age_us = 2_000_000,
            5 => (torque, grown) = (0, -400),
            _ => (torque, state.step.astray_ms) = (self.band_mnm.saturating_add(100), ASTRAY_MS),
        }
        state.step.torque_mnm = torque.saturating_sub(grown);
        // The least count that is cut to so many mN.m again.
        let count = torque
            .saturating_mul(4096)
            .saturating_add(999)
            .saturating_div(1000);
        let [count, mode] = [count, mode].map(|field| u64::from(field.cast_unsigned()));
        let word = (count << 12).saturating_add(mode << 32);
        (state, word.to_le_bytes())
    }
}

impl MonitorState {
    /// Takes the frames that arrived. Returns whether there is a new lane sample to go by.
    fn observe(&mut self, evidence: &Evidence<'_>, elapsed_us: i32, monitor: &Monitor) -> bool {
        self.step.age_us = self.step.age_us.saturating_add(elapsed_us);
        self.step.unheard_us = self.step.unheard_us.saturating_add(elapsed_us);
        self.step.aside_us = self.step.aside_us.saturating_sub(elapsed_us).max(0);
        self.step.window_us = self.step.window_us.saturating_add(elapsed_us);
        let frames = evidence.frames;
        let may_be_aside = frames.new.lane && self.may_leave_aside();
        let is_newer = frames.new.lane && !(may_be_aside && says_aside(evidence.guidance));
        if is_newer {
            let bytes = &frames.lane;
            let new = Lane {
                e_y_mm: field(bytes, 12, 17).saturating_mul(1000) / 8192,
                e_theta_urad: field(bytes, 29, 17).saturating_mul(15_259) / 1000,
            };
            let age_us = (field(bytes, 46, 10) & 0x1FF)
                .saturating_add((field(bytes, 56, 3) & 3).saturating_mul(512))
                .saturating_mul(100);
            let apart_us = self.step.age_us.saturating_sub(age_us);
            // After a gap there is no rate.
            if self.step.age_us > OLDEST_LANE_US {
                (self.lane_state.before, self.lane_state.older_us) = (new, 0);
            } else if self.lane_state.older_us > RATE_SPAN_US {
                (self.lane_state.before, self.lane_state.older_us) = (self.lane_state.lane, apart_us);
            } else {
                self.lane_state.older_us = self.lane_state.older_us.saturating_add(apart_us);
            }
            (self.lane_state.lane, self.step.age_us) = (new, age_us);
            // The line is found: the next picture counts, whatever is said of it.
            self.step.aside_us = 0;
        }
        if frames.new.column {
            let driver = field(&frames.column, 12, 18).saturating_mul(1000) / 4096;
            // A sensor of the hands' torque has no wheel above it: its reading is all that they do.
            if monitor.wheel_mnm_per_mrad > 0 {
                self.see_hands(driver, field(&frames.column, 30, 18), monitor);
            }
            self.see_driver(driver, monitor.window_us);
        }
        self.step.probe_left_us = self.step.probe_left_us.saturating_sub(elapsed_us).max(0);
        if frames.new.request && field(&frames.request, 21, 1) != 0 {
            self.step.probe_left_us = PROBE_END_US;
        }
        is_newer
    }

    /// Takes what the hands do if a bar shows `driver`: beside it they turn the wheel, whose acceleration follows from the angle of its
    /// column in 0.01 deg.
    #[inline(never)]
    #[expect(
        clippy::arithmetic_side_effects,
        reason = "the sum of a lag and a time is above zero"
    )]
    fn see_hands(&mut self, driver: i32, angle: i32, monitor: &Monitor) {
        let angle_urad = angle.saturating_mul(ANGLE_URAD);
        // A column that was silent for longer than a lag counts as heard a lag ago.
        let apart_us = self.step.window_us.saturating_sub(self.wheel.heard_us);
        let apart_ms = (apart_us / 1000).clamp(1, LAG_MS);
        let follow = |lagged: &mut i32, ahead_urad: i32| {
            let apart_urad = ahead_urad.saturating_sub(*lagged);
            let moved_urad = apart_urad.saturating_mul(apart_ms) / (LAG_MS + apart_ms);
            *lagged = lagged.saturating_add(moved_urad);
        };
        let [once, twice] = &mut self.wheel.lagged_urad;
        follow(once, angle_urad);
        follow(twice, *once);
        // Two lags of the acceleration, times the square of a lag.
        let bent_urad = angle_urad
            .saturating_sub(once.saturating_mul(2))
            .saturating_add(*twice);
        let turning = monitor.wheel_mnm_per_mrad.saturating_mul(bent_urad / 1000);
        self.see_driver(driver.saturating_add(turning), monitor.window_us);
        self.wheel.heard_us = self.step.window_us;
    }

    /// Takes a driver torque. What is older than two windows does not count.
    fn see_driver(&mut self, driver: i32, length_us: i32) {
        let [now, before] = &mut self.step.driver_mnm;
        let passed_us = self.step.window_us;
        if passed_us < length_us {
            let [low, high] = *now;
            *now = [low.min(driver), high.max(driver)];
            return;
        }
        let is_old = passed_us >= length_us.saturating_mul(2);
        *before = if is_old { [driver; 2] } else { *now };
        (*now, self.step.window_us) = ([driver; 2], 0);
    }

    /// Least and largest driver torque of the window that goes on and the one before.
    fn driver_range(&self) -> [i32; 2] {
        let [[low, high], [low_before, high_before]] = self.step.driver_mnm;
        [low.min(low_before), high.max(high_before)]
    }

    /// Takes note of a picture that came, and says whether it may be left aside, as one of another line. A guidance frame that claims one
    /// is trusted behind a silence of the camera alone, which the monitor measures itself. A camera that has become slower is no
    /// silent one: its second picture comes after as long as its first.
    fn may_leave_aside(&mut self) -> bool {
        let apart_us = self.step.unheard_us;
        let before_us = self.lane_state.apart_us;
        let period_us = self.lane_state.period_us;
        let is_silence = apart_us > SILENT_US
            && apart_us > period_us.saturating_mul(5) / 2
            && apart_us > before_us.saturating_mul(3) / 2;
        if is_silence {
            self.step.aside_us = ASIDE_US;
        } else if apart_us > period_us {
            self.lane_state.period_us = apart_us.min(LONGEST_PERIOD_US);
        } else {
            let shorter = period_us.saturating_sub(apart_us) / 64;
            self.lane_state.period_us = period_us.saturating_sub(shorter);
        }
        (self.step.unheard_us, self.lane_state.apart_us) = (0, apart_us);
        self.step.aside_us > 0
    }

    /// How fast the lane errors move, mm/s and urad/s.
    #[expect(
        clippy::arithmetic_side_effects,
        reason = "the span is at least a millisecond"
    )]
    fn rates(&self) -> (i32, i32) {
        let (lane, before) = (&self.lane_state.lane, &self.lane_state.before);
        let span_ms = (self.lane_state.older_us / 1000).max(1);
        let e_y_mmps = lane
            .e_y_mm
            .saturating_sub(before.e_y_mm)
            .saturating_mul(1000)
            .saturating_div(span_ms);
        let e_theta_urps = lane
            .e_theta_urad
            .saturating_sub(before.e_theta_urad)
            .saturating_div(span_ms)
            .saturating_mul(1000);
        (e_y_mmps, e_theta_urps)
    }
}

/// Whether a guidance frame says LaneTimeout or LaneStep.
fn says_aside(guidance: &[u8; 8]) -> bool {
    field(guidance, 37, 1) | field(guidance, 52, 1) != 0
}

/// A signed little-endian bit field.
#[expect(clippy::as_conversions, reason = "fewer bits than an i32 has")]
fn field(bytes: &[u8; 8], start: u32, length: u32) -> i32 {
    let up = 64_u32.wrapping_sub(start).wrapping_sub(length);
    let down = 64_u32.wrapping_sub(length);
    i64::from_le_bytes(*bytes).wrapping_shl(up).wrapping_shr(down) as i32
}
