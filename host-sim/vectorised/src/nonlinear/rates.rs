//! The equations of the plants, in the order of `models::nonlinear`.

use super::{Acting, NonlinearVehicles, State};
use haptic_sim::models::nonlinear::{FULL_ASSIST_AT_NM, RIPPLES, STATES, TRAIL_SHAPE};

impl<const N: usize> NonlinearVehicles<N> {
    /// The rates of the states at a share of the step.
    #[inline(always)]
    pub(super) fn rates(&self, x: &State<N>, share: f64, acting: &Acting<N>, moves: &[bool; N]) -> State<N> {
        let [lateral, yaw_rate, wheel, wheel_rate, deflection, arm, motor, _] = x;
        let mut v = [0.0; N];
        for l in 0..N {
            let (from, to) = (acting.speeds[0][l], acting.speeds[1][l]);
            v[l] = from + share * (to - from);
        }
        let ([front, rear], trail) = self.tyres([lateral, yaw_rate, wheel, &v], moves);
        let mut ripple = [0.0; N];
        for l in 0..N {
            if moves[l] && self.ripple[l] != 0.0 {
                ripple[l] = self.ripple[l] * (RIPPLES * wheel[l]).sin();
            }
        }
        let mut rates = [[0.0; N]; STATES];
        for l in 0..N {
            let told = acting.torque_nm[l];
            let lags = self.lag[l] > 0.0;
            let torque = if lags { motor[l] } else { told };
            let motor_rate = (told - motor[l]) / self.lag[l];
            let acts = torque * self.gain[l] + ripple[l];

            let lever = self.lever[l] * (self.castor_share[l] + (1.0 - self.castor_share[l]) * trail[l]);
            let lateral_rate =
                (front[l] + rear[l] + self.force[l]) / self.m[l] + self.gravity[l] - v[l] * yaw_rate[l];
            let turning = (self.l_f[l] * front[l] - self.l_r[l] * rear[l] + self.moment[l]) / self.i[l];
            let hands = arm[l] + acting.remnant_nm[l];
            let boost = (hands.abs() / FULL_ASSIST_AT_NM).min(1.0);
            let slowness = self.assist_speed[l] / (self.assist_speed[l] + v[l]);
            let assist = self.assist[l] * slowness * boost * boost * hands.signum();
            let all = hands + acts + assist + -lever * front[l];
            let given_way = deflection[l] / self.give[l];
            let against = self.damping[l] * wheel_rate[l] + self.friction[l] * given_way;

            let target = acting.target[l] + share * (acting.next_target[l] - acting.target[l]);
            let vision = self.k_d[l] * target + self.k_nms[l] * (target - wheel[l]);
            rates[0][l] = lateral_rate;
            rates[1][l] = turning;
            rates[2][l] = wheel_rate[l];
            rates[3][l] = (all - against) / self.inertia[l];
            rates[4][l] = wheel_rate[l] - wheel_rate[l].abs() * given_way;
            rates[5][l] = (vision - self.k_hg[l] * acts - arm[l]) / self.t_nms[l];
            rates[6][l] = if lags { motor_rate } else { 0.0 };
            rates[7][l] = yaw_rate[l];
        }
        rates
    }

    /// Forces of front and rear axle, N, and what is left of the trail.
    #[inline(always)]
    fn tyres(
        &self,
        [lateral, yaw_rate, wheel, v]: [&[f64; N]; 4],
        moves: &[bool; N],
    ) -> ([[f64; N]; 2], [f64; N]) {
        let (mut across, mut angle, mut force) = ([[0.0; N]; 2], [[0.0; N]; 2], [[0.0; N]; 2]);
        let mut trail = [1.0; N];
        let mut saturates = false;
        for l in 0..N {
            across[0][l] = lateral[l] + self.l_f[l] * yaw_rate[l];
            across[1][l] = lateral[l] + -self.l_r[l] * yaw_rate[l];
            angle[0][l] = across[0][l] / v[l];
            angle[1][l] = across[1][l] / v[l];
            saturates |= self.saturates[l] & moves[l];
        }
        if saturates {
            for l in 0..N {
                if self.saturates[l] & moves[l] {
                    angle[0][l] = across[0][l].atan2(v[l]);
                    angle[1][l] = across[1][l].atan2(v[l]);
                }
            }
        }
        for l in 0..N {
            force[0][l] = self.stiffness[0][l] * (self.k_t[l] * wheel[l] - angle[0][l]);
            force[1][l] = self.stiffness[1][l] * (0.0 - angle[1][l]);
        }
        if saturates {
            for axle in 0..2 {
                for l in 0..N {
                    let most = self.most[axle][l];
                    let slip = force[axle][l] / most;
                    angle[axle][l] = slip;
                    let square = slip * slip;
                    let bent = most * slip / (1.0 + square * square).sqrt().sqrt();
                    force[axle][l] = if self.saturates[l] { bent } else { force[axle][l] };
                }
            }
            for l in 0..N {
                if self.saturates[l] & moves[l] {
                    trail[l] = (TRAIL_SHAPE * angle[0][l].atan()).cos().max(0.0);
                }
            }
        }
        (force, trail)
    }
}
