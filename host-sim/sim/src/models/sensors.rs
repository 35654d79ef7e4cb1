//! The apparatus of the paper's experiment: what the column's sensors resolve, and when the camera looks.
//!
//! Not here: noise, latency of the camera (the paper gives none), and the resolution of the bus.

/// Resolution of the driver torque sensor, N.m.
pub const TORQUE_RESOLUTION_NM: f64 = 0.005;
/// Resolution of the wheel angle sensor, deg.
pub const ANGLE_RESOLUTION_DEG: f64 = 0.1;

/// The driver torque as its sensor gives it, N.m.
pub fn torque_nm(truth_nm: f64) -> f64 {
    (truth_nm / TORQUE_RESOLUTION_NM).round() * TORQUE_RESOLUTION_NM
}

/// The wheel angle as its sensor gives it, rad.
pub fn wheel_angle_rad(truth_rad: f64) -> f64 {
    (truth_rad.to_degrees() / ANGLE_RESOLUTION_DEG).round() * ANGLE_RESOLUTION_DEG.to_radians()
}

/// Whether the camera takes a picture at this step: picture n is due at n/120 s and taken at the first step
/// not before it, so 9, 8 and 8 ms apart in turn, beginning at step 0.
#[inline]
pub fn camera_looks(step: u32) -> bool {
    // Three pictures in 25 steps: due at 0, 8.3 and 16.7 ms.
    matches!(step % 25, 0 | 9 | 17)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_camera_takes_120_pictures_a_second_on_the_grid() {
        let steps: Vec<u32> = (0..=50).filter(|&step| camera_looks(step)).collect();
        // ceil(n * 1000/120 ms) by hand.
        assert_eq!(steps, [0, 9, 17, 25, 34, 42, 50]);
        assert_eq!((0..10_000).filter(|&step| camera_looks(step)).count(), 1200);
    }

    #[test]
    fn sensors_round_to_their_resolution() {
        for (truth, seen) in [(0.0024, 0.0), (0.0026, 0.005), (-0.4726, -0.475), (1.2345, 1.235)] {
            assert!((torque_nm(truth) - seen).abs() < 1e-12, "{truth}");
        }
        for (truth_deg, seen_deg) in [(0.049, 0.0), (0.051, 0.1), (-12.36, -12.4)] {
            let seen = wheel_angle_rad(f64::to_radians(truth_deg)).to_degrees();
            assert!((seen - seen_deg).abs() < 1e-9, "{truth_deg}: {seen}");
        }
    }
}
