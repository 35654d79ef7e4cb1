//! What reaches the ECUs in a step: frames of the vehicle, the column and the camera, and what the motors deliver.

use super::{Runs, WHEEL, YAW_RATE};
use crate::counts::si;

/// The rhythm of a camera and of the frames, ms.
const CAMERA_MS: u32 = 25;
const COLUMN_MS: u32 = 2;
const VEHICLE_MS: u32 = 10;

impl<const N: usize> Runs<N> {
    /// The frames of a step reach the ECUs.
    #[inline(always)]
    pub(super) fn receive(&mut self, phase: u32, looks: bool, driver_nm: &[f64; N]) {
        let Self {
            worlds,
            ecus,
            checks,
            senses,
            speeds,
            own,
            ..
        } = self;
        let matters = ecus.matters;
        let mut turns = None;
        if phase.is_multiple_of(VEHICLE_MS) {
            speeds.receive(ecus, checks, &matters);
            let yaw_rate = senses.yaw_rate(own, &worlds.state[YAW_RATE]);
            checks.vehicle(&yaw_rate, &matters, &mut ecus.suspect);
            turns = Some(yaw_rate);
        }
        if phase.is_multiple_of(COLUMN_MS) {
            let [driver_nm, wheel] = senses.column(driver_nm, &worlds.state[WHEEL]);
            ecus.column(&driver_nm);
            let [driver, applied] = [&ecus.driver, &ecus.applied].map(si);
            checks.column(&driver, &applied, &wheel, &matters, &mut ecus.suspect);
        }
        if looks {
            let dt_ms = if phase % CAMERA_MS == 9 { 9 } else { 8 };
            let camera = &worlds.camera;
            let [e_y, e_theta] = senses.picture(own, &ecus.hears, [&camera.e_y, &camera.e_theta]);
            let seen = ecus.picture(&e_y, &e_theta, dt_ms, own);
            let mut heard = matters;
            for l in 0..N {
                heard[l] &= ecus.hears[l];
            }
            let times = [dt_ms, phase % VEHICLE_MS];
            let keeps = phase.is_multiple_of(CAMERA_MS);
            checks.picture(&seen, times, own, keeps, &heard, &mut ecus.suspect);
        }
        if ecus.has_coasts {
            for (l, own) in own.iter().enumerate() {
                let heard = turns.map(|yaw_rate| [checks.speed(l), yaw_rate[l]]);
                ecus.watch(l, *own as u32, heard, looks);
            }
        }
    }

    /// The motors' torques reach the ECUs.
    #[inline(always)]
    pub(super) fn hear_motors(&mut self, phase: u32) {
        let Self { worlds, ecus, .. } = self;
        let (matters, is_heard) = (ecus.matters, phase.is_multiple_of(COLUMN_MS));
        worlds
            .nonlinear
            .judge(is_heard, &ecus.applied, &matters, &mut ecus.suspect);
    }
}
