//! The rows of a recorded drive that tell the vehicle: stretches on an even grid, in SI units.

use super::VehicleError;

/// Slowest speed that is used, m/s: below it tyres roll as the geometry says, and their slip tells nothing.
const LEAST_SPEED_M_PER_S: f64 = 4.0;
/// Largest lateral acceleration that is used, m/s2: up to there tyres answer in proportion to slip within some per cent.
pub const MOST_LATERAL_M_PER_S2: f64 = 4.0;
/// Shortest stretch, s.
const SHORTEST_S: f64 = 6.0;
/// Shortest record, s.
const SHORTEST_RECORD_S: f64 = 10.0;
/// Speeds of one model: within 2 %, and the model is made for their mean.
const SPEED_BIN: f64 = 0.02;
/// Sample rates that are read, Hz. Below 10 Hz the column's motion is lost between two rows.
const RATES_HZ: [f64; 2] = [9.5, 2000.0];
/// A yaw rate below this is no turn, rad/s.
const TURN_RAD_S: f64 = 0.01;
/// Steering ratios that a road vehicle can have; others are another unit.
const RATIOS: [f64; 2] = [4.0, 60.0];

/// Columns of a drive on one even grid; what is missing is NaN.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct VehicleColumns {
    /// The instants, s.
    pub time_s: Vec<f64>,
    /// Angle of the steering wheel, rad.
    pub wheel_angle_rad: Vec<f64>,
    /// Yaw rate, rad/s.
    pub yaw_rate_rad_per_s: Vec<f64>,
    /// Speed, m/s.
    pub speed_m_per_s: Vec<f64>,
    /// Torque of the driver's hands on the column, N.m; none if it is not recorded.
    pub driver_torque_nm: Option<Vec<f64>>,
    /// Torque of the motor, N.m; none if nobody guides.
    pub guidance_torque_nm: Option<Vec<f64>>,
}

impl VehicleColumns {
    /// What hands and motor do on a row, if the hands' torque is recorded.
    fn torque_nm(&self, k: usize) -> Option<f64> {
        let guidance = self.guidance_torque_nm.as_ref().map_or(0.0, |torque| torque[k]);
        Some(self.driver_torque_nm.as_ref()?[k] + guidance)
    }
}

/// A stretch without a gap.
#[derive(Debug, Clone)]
pub(super) struct Stretch {
    pub(super) wheel_rad: Vec<f64>,
    pub(super) yaw_rate: Vec<f64>,
    pub(super) speed: Vec<f64>,
    pub(super) driver_nm: Option<Vec<f64>>,
    /// The sum of what hands and motor do.
    pub(super) torque_nm: Option<Vec<f64>>,
    /// Place of each row's speed in [`VehicleLog::speeds`].
    pub(super) bin: Vec<usize>,
}

/// What is used of a drive.
#[derive(Debug, Clone)]
pub struct VehicleLog {
    pub(super) step_s: f64,
    pub(super) stretches: Vec<Stretch>,
    /// The speeds at which the model is made, m/s.
    pub(super) speeds: Vec<f64>,
    /// Seconds that are used.
    pub(super) used_s: f64,
    /// Seconds of the record.
    pub(super) recorded_s: f64,
    /// Seconds that were left out because of their lateral acceleration.
    pub(super) fast_s: f64,
    pub(super) mean_speed_m_per_s: f64,
}

impl VehicleLog {
    /// Checks the columns and keeps what can be used.
    ///
    /// # Errors
    /// Columns of other lengths, an uneven or a too coarse grid, a unit or a sign that cannot be, a record that is too short.
    pub fn new(columns: &VehicleColumns, wheelbase_m: f64) -> Result<Self, VehicleError> {
        let rows = columns.time_s.len();
        let lists = [
            &columns.wheel_angle_rad,
            &columns.yaw_rate_rad_per_s,
            &columns.speed_m_per_s,
        ];
        if lists
            .into_iter()
            .chain(&columns.driver_torque_nm)
            .chain(&columns.guidance_torque_nm)
            .any(|list| list.len() != rows)
        {
            return Err(VehicleError::Lengths);
        }
        let step_s = even_step(&columns.time_s)?;
        check_units(columns, wheelbase_m)?;
        let mut log = Self {
            step_s,
            stretches: Vec::new(),
            speeds: Vec::new(),
            used_s: 0.0,
            recorded_s: step_s * rows as f64,
            fast_s: 0.0,
            mean_speed_m_per_s: 0.0,
        };
        let mut from = 0;
        for k in 0..=rows {
            if k < rows && log.is_usable(columns, k) {
                continue;
            }
            if (k - from) as f64 * step_s >= SHORTEST_S {
                log.stretches.push(Stretch::of(columns, from, k));
            }
            from = k + 1;
        }
        let used: usize = log.stretches.iter().map(|s| s.speed.len()).sum();
        log.used_s = used as f64 * step_s;
        if log.used_s < SHORTEST_RECORD_S {
            return Err(VehicleError::TooShort {
                used_s: log.used_s,
                recorded_s: log.recorded_s,
            });
        }
        log.mean_speed_m_per_s = log.all_speeds().sum::<f64>() / used as f64;
        log.make_bins();
        Ok(log)
    }

    fn is_usable(&mut self, columns: &VehicleColumns, k: usize) -> bool {
        let (wheel, r) = (columns.wheel_angle_rad[k], columns.yaw_rate_rad_per_s[k]);
        let v = columns.speed_m_per_s[k];
        let torque = columns.torque_nm(k).unwrap_or(0.0);
        let is_fast = (v * r).abs() > MOST_LATERAL_M_PER_S2;
        if is_fast {
            self.fast_s += self.step_s;
        }
        (wheel + r + v + torque).is_finite() && v >= LEAST_SPEED_M_PER_S && !is_fast
    }

    fn all_speeds(&self) -> impl Iterator<Item = f64> {
        self.stretches.iter().flat_map(|s| s.speed.iter().copied())
    }

    fn make_bins(&mut self) {
        let least = self.all_speeds().fold(f64::INFINITY, f64::min);
        let bin = |v: f64| ((v / least).ln() / SPEED_BIN).round() as usize;
        let mut sums: Vec<(f64, f64)> = Vec::new();
        for stretch in &mut self.stretches {
            stretch.bin = stretch.speed.iter().map(|v| bin(*v)).collect();
            for (v, bin) in stretch.speed.iter().zip(&stretch.bin) {
                sums.resize(sums.len().max(bin + 1), (0.0, 0.0));
                sums[*bin] = (sums[*bin].0 + v, sums[*bin].1 + 1.0);
            }
        }
        self.speeds = sums
            .iter()
            .map(|(sum, count)| if *count > 0.0 { sum / count } else { 0.0 })
            .collect();
    }

    /// The least and the largest speed that is used, m/s.
    pub(super) fn speed_range(&self) -> [f64; 2] {
        let fold = |start, pick: fn(f64, f64) -> f64| self.all_speeds().fold(start, pick);
        [fold(f64::INFINITY, f64::min), fold(0.0, f64::max)]
    }

    /// Whether the torques are recorded.
    pub(super) fn has_torque(&self) -> bool {
        self.stretches.iter().all(|s| s.torque_nm.is_some())
    }
}

impl Stretch {
    fn of(columns: &VehicleColumns, from: usize, to: usize) -> Self {
        Self {
            wheel_rad: columns.wheel_angle_rad[from..to].to_vec(),
            yaw_rate: columns.yaw_rate_rad_per_s[from..to].to_vec(),
            speed: columns.speed_m_per_s[from..to].to_vec(),
            driver_nm: columns
                .driver_torque_nm
                .as_ref()
                .map(|torque| torque[from..to].to_vec()),
            torque_nm: (from..to).map(|k| columns.torque_nm(k)).collect(),
            bin: Vec::new(),
        }
    }
}

fn even_step(time_s: &[f64]) -> Result<f64, VehicleError> {
    let rows = time_s.len();
    if rows < 3 {
        return Err(VehicleError::TooShort {
            used_s: 0.0,
            recorded_s: 0.0,
        });
    }
    let step_s = (time_s[rows - 1] - time_s[0]) / (rows - 1) as f64;
    let [least, most] = RATES_HZ;
    if !(least..=most).contains(&(1.0 / step_s)) {
        return Err(VehicleError::Rate {
            hz: 1.0 / step_s,
            least,
            most,
        });
    }
    let uneven = time_s
        .windows(2)
        .position(|w| ((w[1] - w[0]) / step_s - 1.0).abs() > 0.01);
    uneven.map_or(Ok(step_s), |row| {
        Err(VehicleError::Uneven {
            time_s: time_s[row + 1],
        })
    })
}

/// A wheel angle in another unit or with another sign shows in the slope of the yaw rate on speed and angle.
fn check_units(columns: &VehicleColumns, wheelbase_m: f64) -> Result<(), VehicleError> {
    let rows = columns
        .wheel_angle_rad
        .iter()
        .zip(&columns.yaw_rate_rad_per_s)
        .zip(&columns.speed_m_per_s);
    let known = rows.map(|((wheel, r), v)| (wheel * v / wheelbase_m, *r, *v));
    let known: Vec<_> = known
        .filter(|(x, r, v)| (x + r).is_finite() && *v >= LEAST_SPEED_M_PER_S)
        .collect();
    let count = known.len() as f64;
    let mean = |of: fn(&(f64, f64, f64)) -> f64| known.iter().map(of).sum::<f64>() / count;
    let (x, r) = (mean(|row| row.0), mean(|row| row.1));
    let sums = known.iter().fold([0.0; 3], |[xx, xr, rr], row| {
        let (dx, dr) = (row.0 - x, row.1 - r);
        [xx + dx * dx, xr + dx * dr, rr + dr * dr]
    });
    let [xx, xr, rr] = sums;
    // Only where the vehicle turns, and the angle explains most of that, its unit and its sign are told.
    if count < 3.0 || rr < count * TURN_RAD_S * TURN_RAD_S || xr * xr < 0.5 * xx * rr {
        return Ok(());
    }
    let ratio = xx / xr;
    if ratio < 0.0 {
        return Err(VehicleError::Sign);
    }
    // Understeer makes the ratio look larger by up to a factor of three.
    if !(RATIOS[0]..=3.0 * RATIOS[1]).contains(&ratio) {
        return Err(VehicleError::Unit { ratio });
    }
    Ok(())
}
