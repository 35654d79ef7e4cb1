//! What the sensors of several runs add to the truth: constant errors for all at once, noise from each run's own gyro and
//! camera ([`haptic_sim::models::disturbances`]), which draw as they do in a run alone.

use super::lanes::lanes;
use haptic_sim::simulation::Sensing;

lanes! {
    /// The sensors.
    pub(super) struct Senses {
        torque_gain: f64 = 1.0,
        torque_bias: f64 = 0.0,
        angle_bias: f64 = 0.0,
    } beside {
        /// The sensors of the runs in which they have errors.
        own: [Option<Box<Sensing>>; N] = [const { None }; N],
        is_any: bool = false,
    }
}

impl<const N: usize> Senses<N> {
    /// A new run begins in a lane.
    pub(super) fn begin(&mut self, lane: usize, sensing: Option<Box<Sensing>>) {
        self.clear(lane);
        if let Some(Sensing { errors, .. }) = sensing.as_deref() {
            self.torque_gain[lane] = errors.torque_gain;
            self.torque_bias[lane] = errors.torque_bias_nm;
            self.angle_bias[lane] = errors.angle_bias_rad;
        }
        self.own[lane] = sensing;
        self.is_any = self.own.iter().any(Option::is_some);
    }

    /// Driver torque and wheel angle.
    #[inline(always)]
    pub(super) fn column(&self, driver_nm: &[f64; N], wheel_rad: &[f64; N]) -> [[f64; N]; 2] {
        if !self.is_any {
            return [*driver_nm, *wheel_rad];
        }
        let mut seen = [[0.0; N]; 2];
        for l in 0..N {
            seen[0][l] = self.torque_gain[l] * driver_nm[l] + self.torque_bias[l];
            seen[1][l] = wheel_rad[l] + self.angle_bias[l];
        }
        seen
    }

    /// The yaw rate, in a step in which it is sent.
    #[inline(always)]
    pub(super) fn yaw_rate(&mut self, own: &[i32; N], truth: &[f64; N]) -> [f64; N] {
        let mut seen = *truth;
        if self.is_any {
            for (l, sensing) in self.own.iter_mut().enumerate() {
                if let Some(sensing) = sensing {
                    seen[l] = sensing.gyro.see(own[l] as u32, truth[l]);
                }
            }
        }
        seen
    }

    /// The lane errors of a picture, m and rad, in the runs that see the road.
    #[inline(always)]
    pub(super) fn picture(
        &mut self,
        own: &[i32; N],
        hears: &[i32; N],
        truth: [&[f64; N]; 2],
    ) -> [[f64; N]; 2] {
        let mut seen = truth.map(|errors| *errors);
        if self.is_any {
            for (l, sensing) in self.own.iter_mut().enumerate() {
                let Some(sensing) = sensing.as_mut().filter(|_| hears[l] != 0) else {
                    continue;
                };
                // A camera that is late or blind is kept out of the lanes: every picture comes at once.
                if let Some((errors, _)) = sensing.camera.see(own[l] as u32, [truth[0][l], truth[1][l]]) {
                    [seen[0][l], seen[1][l]] = errors;
                }
            }
        }
        seen
    }
}
