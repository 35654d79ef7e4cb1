//! The points that driver and camera look at in several runs, as a run alone has them.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use super::lanes::lanes;
use super::tracked::{HEADING, OFFSET, Tracked};
use haptic_sim::models::road::Centreline;

lanes! {
    /// A near and a far point of each run.
    pub(super) struct Points {
        /// How far ahead they are, m.
        pub(super) near_m: f64 = 0.0,
        pub(super) far_m: f64 = 0.0,
        /// The errors found.
        pub(super) e_y: f64 = 0.0,
        pub(super) e_theta: f64 = 0.0,
    } beside {
        /// How far ahead they are, s.
        pub(super) times_s: [[f64; N]; 2] = [[0.0; N]; 2],
        near: Tracked<N> = Tracked::new(),
        pub(super) far: Tracked<N> = Tracked::new(),
    }
}

impl<const N: usize> Points<N> {
    /// A new run begins in a lane: its points are so far ahead at this speed.
    pub(super) fn begin(&mut self, lane: usize, road: &Centreline, times_s: [f64; 2], v_m_per_s: f64) {
        self.clear(lane);
        [self.times_s[0][lane], self.times_s[1][lane]] = times_s;
        let [near_m, far_m] = times_s.map(|time_s| v_m_per_s * time_s);
        (self.near_m[lane], self.far_m[lane]) = (near_m, far_m);
        self.near.begin(lane, road, &road.tracker(near_m));
        self.far.begin(lane, road, &road.tracker(far_m));
    }

    /// Looks at the road from a place in a direction, as a unit vector and as an angle, in the runs that are selected.
    /// Which of them has no foot, or an angle that would have to be wrapped, becomes suspect.
    #[inline(always)]
    pub(super) fn observe(
        &mut self,
        roads: &[Arc<Centreline>; N],
        (x, y, direction): (&[f64; N], &[f64; N], &[[f64; N]; 2]),
        chi: &[f64; N],
        selected: &[u64; N],
        longer: &[f64; N],
        suspect: &mut [u64; N],
    ) {
        let (mut px, mut py) = ([0.0; N], [0.0; N]);
        for l in 0..N {
            px[l] = x[l] + self.near_m[l] * direction[0][l];
            py[l] = y[l] + self.near_m[l] * direction[1][l];
        }
        let lost_near = self.near.project::<OFFSET>(roads, &px, &py, selected, longer);
        for l in 0..N {
            px[l] = x[l] + self.far_m[l] * direction[0][l];
            py[l] = y[l] + self.far_m[l] * direction[1][l];
        }
        let lost_far = self.far.project::<HEADING>(roads, &px, &py, selected, longer);
        for l in 0..N {
            // An angle that would have to be wrapped is that of a run that turns.
            let e_theta = self.far.found_heading[l] - chi[l];
            let is_sound = e_theta.abs() < FRAC_PI_2;
            suspect[l] |= lost_near[l] | lost_far[l] | if is_sound { 0 } else { selected[l] };
            self.e_y[l] = -self.near.offset[l];
            self.e_theta[l] = e_theta;
        }
    }
}
