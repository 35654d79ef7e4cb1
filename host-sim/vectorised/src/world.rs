//! The world of several runs: plant, driver and the points that they look at, to the same bits as
//! [`haptic_sim::Simulation`] has them one by one.

use std::sync::Arc;

use super::lanes::lanes;
use super::nonlinear::{Acting, NonlinearVehicles};
use super::points::Points;
use super::tracked::{ALL, Tracked};
use super::{ALIVE, ARM, Aligned, BETA, WHEEL, WHEEL_RATE, YAW, YAW_RATE};
use haptic_sim::models::STEP_S;
use haptic_sim::models::driver::delay_steps;
use haptic_sim::models::plant::{COLUMNS, STATES, Transition, rotated, unit};
use haptic_sim::models::road::Centreline;
use haptic_sim::scenario::Scenario;
use haptic_sim::simulation::{DIVERGED_M, Plan};

lanes! {
    /// The worlds; `whole` is the longest delay, in steps.
    pub(super) struct Worlds {
        x: f64 = 0.0,
        y: f64 = 0.0,
        distance: f64 = 0.0,
        /// The driver's line, m right of the middle.
        right: f64 = 0.0,
        integral: f64 = 0.0,
        last_e_y: f64 = 0.0,
        fraction: f64 = 0.0,
        older: f64 = 0.0,
        target: f64 = 0.0,
        end: f64 = 0.0,
        pub(super) remnant_nm: f64 = 0.0,
        /// [`ALIVE`] where a run is under way.
        pub(super) alive: u64 = 0,
        /// Not 0 where something happened that is not modelled here.
        pub(super) suspect: u64 = 0,
        whole: usize = 1,
    } beside (whole: usize) {
        pub(super) state: [[f64; N]; STATES] = [[0.0; N]; STATES],
        direction: [[f64; N]; 2] = [[1.0; N], [0.0; N]],
        columns: [[[f64; N]; STATES]; COLUMNS] = [[[0.0; N]; STATES]; COLUMNS],
        a: [[f64; N]; 3] = [[0.0; N]; 3],
        pub(super) driver: Points<N> = Points::new(),
        pub(super) camera: Points<N> = Points::new(),
        pub(super) body: Tracked<N> = Tracked::new(),
        pub(super) nonlinear: NonlinearVehicles<N> = NonlinearVehicles::new(),
        /// Inputs of the delays, one row a step.
        delayed: Vec<[f64; N]> = vec![[0.0; N]; (whole + 1).next_power_of_two()],
        next: usize = 0,
    }
}

impl<const N: usize> Worlds<N> {
    /// A new run begins in a lane, as a simulation of it begins.
    pub(super) fn begin(&mut self, lane: usize, scenario: &Scenario, road: &Centreline, plan: &Plan) {
        self.clear(lane);
        for state in &mut self.state {
            state[lane] = 0.0;
        }
        (self.direction[0][lane], self.direction[1][lane]) = (1.0, 0.0);
        let (driver, guidance) = (scenario.driver(), scenario.guidance());
        [self.a[0][lane], self.a[1][lane], self.a[2][lane]] = [driver.a_1, driver.a_2, driver.a_3];
        self.right[lane] = driver.right_m();
        (self.whole[lane], self.fraction[lane]) = delay_steps(driver.t_p);
        for row in &mut self.delayed {
            row[lane] = 0.0;
        }
        let v = scenario.speed_m_per_s();
        self.driver.begin(lane, road, [driver.t_n, driver.t_f], v);
        self.camera.begin(lane, road, [guidance.t_n, guidance.t_f], v);
        self.body.begin(lane, road, &road.tracker(0.0));
        self.end[lane] = plan.end_m(road, v);
        self.alive[lane] = ALIVE;
    }

    /// A run goes at another speed, and its course ends where its driver's far point is at `end_m`.
    pub(super) fn at_speed(&mut self, lane: usize, v_m_per_s: f64, end_m: f64) {
        for points in [&mut self.driver, &mut self.camera] {
            points.near_m[lane] = v_m_per_s * points.times_s[0][lane];
            points.far_m[lane] = v_m_per_s * points.times_s[1][lane];
        }
        self.end[lane] = end_m;
    }

    /// How the arm of a run moves from now on.
    pub(super) fn set_transition(&mut self, lane: usize, transition: &Transition) {
        for (all, column) in self.columns.iter_mut().zip(&transition.columns) {
            for (row, entry) in all.iter_mut().zip(column) {
                row[lane] = *entry;
            }
        }
        self.distance[lane] = transition.distance_m;
        self.nonlinear.set_gains(lane, transition.gains());
    }

    /// chi of each run, rad.
    #[inline(always)]
    pub(super) fn direction_rad(&self) -> [f64; N] {
        let mut chi = [0.0; N];
        for l in 0..N {
            chi[l] = self.state[YAW][l] + self.state[BETA][l];
        }
        chi
    }

    /// The driver looks at the road; returns whether a run that is alive has come to its end.
    #[inline(always)]
    pub(super) fn driver_looks(&mut self, roads: &[Arc<Centreline>; N]) -> bool {
        let selected = self.alive;
        let chi = self.direction_rad();
        let place = (&self.x, &self.y, &self.direction);
        self.driver
            .observe(roads, place, &chi, &selected, &[1.0; N], &mut self.suspect);
        let mut ended = 0;
        for l in 0..N {
            ended |= if self.driver.far.s[l] >= self.end[l] {
                selected[l]
            } else {
                0
            };
        }
        ended != 0
    }

    /// Whether the run of a lane has come to its end.
    pub(super) fn is_at_its_end(&self, lane: usize) -> bool {
        self.driver.far.s[lane] >= self.end[lane]
    }

    /// The camera looks at the road in the runs that are selected. `longer` is the time since the last look over the time
    /// between the last two.
    #[inline(always)]
    pub(super) fn camera_looks(
        &mut self,
        roads: &[Arc<Centreline>; N],
        selected: &[u64; N],
        longer: &[f64; N],
    ) {
        let chi = self.direction_rad();
        let place = (&self.x, &self.y, &self.direction);
        self.camera
            .observe(roads, place, &chi, selected, longer, &mut self.suspect);
    }

    /// Where the centres of gravity are on their roads.
    #[inline(always)]
    pub(super) fn locate(&mut self, roads: &[Arc<Centreline>; N]) {
        let lost = self
            .body
            .project::<ALL>(roads, &self.x, &self.y, &self.alive, &[1.0; N]);
        for l in 0..N {
            let is_off = self.body.offset[l].abs() > DIVERGED_M;
            self.suspect[l] |= lost[l] | if is_off { self.alive[l] } else { 0 };
        }
        self.nonlinear.locate(roads, |lane| self.body.place(lane));
    }

    /// The drivers' eyes and arms, columns and vehicles move for a millisecond, from one speed to the next.
    #[inline(always)]
    pub(super) fn move_on(&mut self, torque_nm: &[f64; N], speeds: [&[f64; N]; 2], has_remnants: bool) {
        let mut places = Aligned(([[0.0; N]; STATES], [0.0; N]));
        let (next, next_target) = (&mut places.0.0, &mut places.0.1);
        self.vision(next_target);
        let before = self.direction_rad();
        // Nothing times something added to a sum that began with zero changes no bit of it.
        if has_remnants {
            self.linear::<true>(next_target, torque_nm, next);
        } else {
            self.linear::<false>(next_target, torque_nm, next);
        }
        let acting = Acting {
            target: &self.target,
            next_target,
            torque_nm,
            speeds,
            remnant_nm: &self.remnant_nm,
            alive: &self.alive,
        };
        self.nonlinear
            .step(&self.state, &acting, next, &mut self.distance);
        (self.state, self.target) = places.0;
        let mut squares = [0.0; N];
        for l in 0..N {
            let half_turn = 0.5 * ((self.state[YAW][l] + self.state[BETA][l]) - before[l]);
            let square = half_turn * half_turn;
            squares[l] = square;
            let direction = unit([self.direction[0][l], self.direction[1][l]]);
            let (sin, cos) = (
                half_turn * (1.0 - square * (1.0 / 6.0)),
                1.0 - square * (0.5 - square * (1.0 / 24.0)),
            );
            let [x, y] = rotated(direction, (sin, cos));
            self.x[l] += self.distance[l] * x;
            self.y[l] += self.distance[l] * y;
            let whole = (2.0 * sin * cos, 1.0 - 2.0 * sin * sin);
            [self.direction[0][l], self.direction[1][l]] = rotated(direction, whole);
        }
        for l in 0..N {
            self.suspect[l] |= if squares[l] < 1e-6 { 0 } else { self.alive[l] };
        }
    }

    /// Equation (7) with its delay.
    #[inline(always)]
    fn vision(&mut self, target: &mut [f64; N]) {
        let mask = self.delayed.len() - 1;
        let mut row = [0.0; N];
        for l in 0..N {
            let (e_y, e_theta) = (self.driver.e_y[l] - self.right[l], self.driver.e_theta[l]);
            self.integral[l] += 0.5 * STEP_S * (e_y + self.last_e_y[l]);
            self.last_e_y[l] = e_y;
            row[l] = self.a[0][l] * e_y + self.a[1][l] * self.integral[l] + self.a[2][l] * e_theta;
        }
        self.delayed[self.next & mask] = row;
        self.next = self.next.wrapping_add(1);
        let mut newer = [0.0; N];
        for l in 0..N {
            newer[l] = self.delayed[self.next.wrapping_sub(self.whole[l]) & mask][l];
        }
        for l in 0..N {
            target[l] = newer[l] + self.fraction[l] * (self.older[l] - newer[l]);
        }
        self.older = newer;
    }

    /// Equations (1) to (6) and (8), in the plant's order of sums.
    #[inline(always)]
    fn linear<const WITH_REMNANT: bool>(
        &self,
        next_target: &[f64; N],
        torque_nm: &[f64; N],
        next: &mut [[f64; N]; STATES],
    ) {
        let [beta, yaw_rate, wheel, wheel_rate, arm, yaw] = &self.state;
        let [c0, c1, c2, c3, c4, c5, c6, c7, c8] = &self.columns;
        let (target, remnant) = (&self.target, &self.remnant_nm);
        // All rows in one loop over the lanes: the compiler then takes as many lanes at once as there are.
        for l in 0..N {
            let row = |row: usize, start: f64| {
                let sum = start
                    + c0[row][l] * beta[l]
                    + c1[row][l] * yaw_rate[l]
                    + c2[row][l] * wheel[l]
                    + c3[row][l] * wheel_rate[l]
                    + c4[row][l] * arm[l]
                    + c5[row][l] * target[l]
                    + c6[row][l] * next_target[l]
                    + c7[row][l] * torque_nm[l];
                if WITH_REMNANT {
                    sum + c8[row][l] * remnant[l]
                } else {
                    sum
                }
            };
            // Every sum begins with a zero, which keeps the signs of zeros.
            next[BETA][l] = row(BETA, 0.0);
            next[YAW_RATE][l] = row(YAW_RATE, 0.0);
            next[WHEEL][l] = row(WHEEL, 0.0);
            next[WHEEL_RATE][l] = row(WHEEL_RATE, 0.0);
            next[ARM][l] = row(ARM, 0.0);
            next[YAW][l] = row(YAW, yaw[l]);
        }
    }
}
