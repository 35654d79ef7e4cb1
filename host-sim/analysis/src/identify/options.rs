//! What the caller knows already: parameters given instead of estimated (`--fix NAME=VALUE`).

use haptic_log::near::did_you_mean;

use super::signals::Muscle;
use haptic_recording::DriveLog;

/// The turn of the road in a bend of 300 m at 60 km/h, rad/s: what a line in bends is judged by.
pub(crate) const BEND_RAD_S: f64 = 60.0 / 3.6 / 300.0;

/// Why a `NAME=VALUE` was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct FixError(pub(crate) String);

/// How well a wheel's inertia is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Inertia {
    /// Give or take 10 %.
    About,
    /// Without an error.
    Exact,
    /// Not at all: the guidance torque of the drive has to tell it, and what is given is where the search begins.
    Sought,
}

/// How a drive is to be identified.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// A drive without guidance: K_hg is not part of the model.
    pub manual: bool,
    /// The muscle, known or assumed.
    pub muscle: Muscle,
    /// Whether t_nms is known exactly: otherwise it is freed where the record draws it away.
    pub t_nms_known: bool,
    /// Whether K_nms is known exactly, likewise.
    pub k_nms_known: bool,
    /// Known offset of the driver's own line, m, and its part in bends, m by rad/s of the road's turn.
    pub line: [Option<f64>; 2],
    /// Inertia of the wheel above a torsion bar that measured T_d, kg.m2; none where T_d is the torque of the hands.
    pub wheel_inertia: Option<f64>,
    /// How well the inertia of the wheel is known.
    pub wheel_inertia_is: Inertia,
    /// Damping of that wheel, N.m.s/rad; none where it is not known, so 0 to 0.05.
    pub wheel_damping: Option<f64>,
    /// Stiffness of the bar, N.m/rad, where the angle is that of the column below it; none where it is the wheel's.
    pub bar_stiffness: Option<f64>,
    /// Whether a power assist that is not in T_h turns the wheel with the driver.
    pub assisted: bool,
    /// Known a_1, a_2, a_3.
    pub a: [Option<f64>; 3],
    /// Known (K_d + K_nms)*a_i.
    pub gain: [Option<f64>; 3],
    /// Known delay, s.
    pub t_p_s: Option<f64>,
    /// Known K_d, N.m/rad.
    pub k_d: Option<f64>,
    /// Known K_hg.
    pub k_hg: Option<f64>,
    /// Known lateness of the recorded T_h and of the recorded T_d, s.
    pub late_s: [f64; 2],
    /// Ranges in which K_nms, t_nms, and the lateness of T_h and of T_d are estimated instead of taken as known.
    pub estimate: [Option<[f64; 2]>; 4],
    /// The stretches to use, from and to, s of the log's time; all if empty.
    pub stretches: Vec<(f64, f64)>,
    /// Pauses of a signal up to so long are bridged, s; longer ones cut the drive. Zero cuts at each.
    pub bridge_s: f64,
    /// Whether the camera's noise is estimated and removed.
    pub lane_noise: bool,
    /// Whether a lane signal is taken as a smooth course alone, without the vehicle's answer to the wheel angle: for
    /// comparison.
    pub plain_smoother: bool,
    /// Whether hands-off, standstill and lane changes are looked for and left out.
    pub leave_out: bool,
}

/// Longest pause of a signal that is bridged unless the caller says otherwise, s: the delay's own size.
const LONGEST_BRIDGE_S: f64 = 0.3;

impl Default for Options {
    fn default() -> Self {
        Self {
            manual: false,
            muscle: Muscle::default(),
            t_nms_known: false,
            k_nms_known: false,
            line: [None; 2],
            wheel_inertia: None,
            wheel_inertia_is: Inertia::About,
            wheel_damping: None,
            bar_stiffness: None,
            assisted: false,
            a: [None; 3],
            gain: [None; 3],
            t_p_s: None,
            k_d: None,
            k_hg: None,
            late_s: [0.0; 2],
            estimate: [None; 4],
            stretches: Vec::new(),
            bridge_s: LONGEST_BRIDGE_S,
            lane_noise: true,
            plain_smoother: false,
            leave_out: true,
        }
    }
}

/// Inertia that a steering wheel may have, kg.m2.
pub const WHEEL_INERTIA_KG_M2: [f64; 2] = [0.001, 0.2];
/// Where the search for one that is not known begins, kg.m2.
const USUAL_INERTIA_KG_M2: f64 = 0.04;
/// Rows that are farther apart do not tell a wheel's acceleration, s.
const LONGEST_WHEEL_ROW_S: f64 = 0.025;
/// Damping of a wheel where nobody says more, N.m.s/rad, and its standard deviation: that of its bearings is 0 to 0.05.
const WHEEL_DAMPING_NMS_PER_RAD: f64 = 0.025;

/// Names that can be fixed, with the range of each.
const FIXABLE: [(&str, f64, f64); 18] = [
    ("a_1", 1e-4, 10.0),
    ("a_2", 1e-4, 10.0),
    ("a_3", 1e-4, 100.0),
    ("gain_1", 0.0, 10.0),
    ("gain_2", 0.0, 10.0),
    ("gain_3", 0.0, 100.0),
    ("t_p", 0.0, 0.6),
    // Above zero, so that there is a scale to split the gains with, whatever K_nms is.
    ("k_d", 0.1, 20.0),
    ("k_hg", 0.0, 1.0),
    ("k_nms", 0.0, 10.0),
    ("t_nms", 0.01, 1.0),
    ("t_h_late", -0.1, 0.3),
    ("t_d_late", -0.1, 0.3),
    ("line_offset", -1.5, 1.5),
    ("line_bend", -1.5, 1.5),
    ("wheel_inertia", WHEEL_INERTIA_KG_M2[0], WHEEL_INERTIA_KG_M2[1]),
    ("wheel_damping", 0.0, 0.5),
    ("bar_stiffness", 5.0, 1000.0),
];

/// Units of what people also have in other ones, such as a bar's stiffness in N.m/deg.
const UNITS: [(&str, &str); 3] = [
    ("wheel_inertia", " kg.m2"),
    ("wheel_damping", " N.m.s/rad"),
    ("bar_stiffness", " N.m/rad"),
];

/// Names that are known unless they are to be estimated, with the range in which they are then searched.
const ESTIMABLE: [(&str, f64, f64); 4] = [
    ("k_nms", 0.0, 10.0),
    ("t_nms", 0.02, 0.5),
    ("t_h_late", -0.1, 0.2),
    ("t_d_late", -0.1, 0.2),
];

impl Options {
    /// What is known of a drive, from every `NAME=VALUE` that was given.
    ///
    /// # Errors
    /// As [`Options::fix`]; a name that is given twice; K_hg of a `manual` drive.
    pub fn given(manual: bool, assignments: &[String]) -> Result<Self, FixError> {
        let mut options = Self {
            manual,
            ..Self::default()
        };
        let mut names = Vec::new();
        for assignment in assignments {
            let name = options.fix(assignment)?;
            if names.contains(&name) {
                return Err(FixError(format!(
                    "--fix {assignment}: {name} is given twice, once is allowed"
                )));
            }
            names.push(name);
        }
        if manual && options.k_hg.is_some() {
            return Err(FixError(
                "--fix k_hg: a --manual drive has no k_hg to fix".to_owned(),
            ));
        }
        Ok(options)
    }

    /// Damping of the wheel above a torsion bar, N.m.s/rad: where nobody says more, the middle of what bearings have.
    pub(crate) fn wheel_damping(&self) -> f64 {
        self.wheel_damping
            .or(self.wheel_inertia.map(|_| WHEEL_DAMPING_NMS_PER_RAD))
            .unwrap_or(0.0)
    }

    /// Takes the inertia of a wheel above a torsion bar, kg.m2, or `estimate`.
    ///
    /// # Errors
    /// Neither, or outside [`WHEEL_INERTIA_KG_M2`]; beside one that is fixed; `estimate` of a drive by hand or beside
    /// a torque that is late.
    pub fn take_inertia(&mut self, text: &str) -> Result<(), FixError> {
        let [least, most] = WHEEL_INERTIA_KG_M2;
        let is_sought = text == "estimate";
        let told = text.parse().ok().filter(|told| (least..=most).contains(told));
        let refused = if self.wheel_inertia.is_some() {
            "--fix wheel_inertia is given too, one of them is allowed".to_owned()
        } else if is_sought && self.manual {
            "a --manual drive has no guidance torque, which alone tells it".to_owned()
        } else if is_sought && self.estimate[2..].iter().any(Option::is_some) {
            "beside --estimate t_h_late or t_d_late the probe tells the one or the other".to_owned()
        } else if !is_sought && told.is_none() {
            format!("{least} to {most} kg.m2 or \"estimate\" is wanted")
        } else {
            self.wheel_inertia = told.or(Some(USUAL_INERTIA_KG_M2));
            if is_sought {
                self.wheel_inertia_is = Inertia::Sought;
            }
            return Ok(());
        };
        Err(FixError(format!("--wheel-inertia {text}: {refused}")))
    }

    /// Takes a `NAME=VALUE` and returns the name.
    ///
    /// # Errors
    /// No `=`, an unknown name, a value that is no number or outside the name's range.
    pub fn fix(&mut self, assignment: &str) -> Result<&'static str, FixError> {
        let Some((name, text)) = assignment.split_once('=') else {
            return Err(FixError(format!(
                "--fix {assignment}: NAME=VALUE is wanted, such as k_d=3.2"
            )));
        };
        let name = name.trim().to_ascii_lowercase();
        let Some(&(name, low, high)) = FIXABLE.iter().find(|(n, ..)| *n == name) else {
            let names: Vec<&str> = FIXABLE.iter().map(|f| f.0).collect();
            return Err(FixError(format!(
                "--fix {name}: unknown, one of {} is wanted{}",
                names.join(", "),
                did_you_mean(&name, names)
            )));
        };
        let value: f64 = text
            .trim()
            .parse()
            .map_err(|_| FixError(format!("--fix {name}: {text:?} is not a number")))?;
        if !(low..=high).contains(&value) {
            let unit = UNITS
                .iter()
                .find(|(n, _)| *n == name)
                .map_or("", |(_, unit)| unit);
            return Err(FixError(format!(
                "--fix {name}: {} is outside {low} to {high}{unit}",
                text.trim()
            )));
        }
        match name {
            "a_1" => self.a[0] = Some(value),
            "a_2" => self.a[1] = Some(value),
            "a_3" => self.a[2] = Some(value),
            "gain_1" => self.gain[0] = Some(value),
            "gain_2" => self.gain[1] = Some(value),
            "gain_3" => self.gain[2] = Some(value),
            "t_p" => self.t_p_s = Some(value),
            "k_d" => self.k_d = Some(value),
            "k_hg" => self.k_hg = Some(value),
            "k_nms" => (self.muscle.k_nms, self.k_nms_known) = (value, true),
            "wheel_inertia" => {
                (self.wheel_inertia, self.wheel_inertia_is) = (Some(value), Inertia::Exact);
            }
            "wheel_damping" => self.wheel_damping = Some(value),
            "bar_stiffness" => self.bar_stiffness = Some(value),
            "line_offset" => self.line[0] = Some(value),
            "line_bend" => self.line[1] = Some(value / BEND_RAD_S),
            "t_h_late" => self.late_s[0] = value,
            "t_d_late" => self.late_s[1] = value,
            _ => (self.muscle.t_nms_s, self.t_nms_known) = (value, true),
        }
        Ok(name)
    }

    /// Takes a `NAME` or a `NAME=LOW..HIGH` of what is to be estimated instead of taken as known.
    ///
    /// # Errors
    /// An unknown name, a range that is none or goes beyond the name's.
    pub fn estimate(&mut self, what: &str) -> Result<(), FixError> {
        let refuse = |why: String| Err(FixError(format!("--estimate {what}: {why}")));
        let (name, range) = what.split_once('=').map_or((what, None), |(n, r)| (n, Some(r)));
        let name = name.trim().to_ascii_lowercase();
        let Some(i) = ESTIMABLE.iter().position(|e| e.0 == name) else {
            let names: Vec<&str> = ESTIMABLE.iter().map(|e| e.0).collect();
            let near = did_you_mean(&name, names.iter().copied());
            return refuse(format!("unknown, one of {} is wanted{near}", names.join(", ")));
        };
        let (_, least, most) = ESTIMABLE[i];
        let [low, high] = match range {
            None => [least, most],
            Some(text) => {
                let ends = text
                    .split_once("..")
                    .map(|(a, b)| (a.trim().parse(), b.trim().parse()));
                let Some((Ok(low), Ok(high))) = ends else {
                    return refuse("LOW..HIGH is wanted, such as t_nms=0.06..0.15".to_owned());
                };
                [low, high]
            }
        };
        if !(low < high && low >= least && high <= most) {
            return refuse(format!("a range within {least} to {most} is wanted"));
        }
        self.estimate[i] = Some([low, high]);
        self.k_nms_known |= i == 0;
        self.t_nms_known |= i == 1;
        let within = |x: &mut f64| *x = x.clamp(low, high);
        match i {
            0 => within(&mut self.muscle.k_nms),
            1 => within(&mut self.muscle.t_nms_s),
            _ => within(&mut self.late_s[i - 2]),
        }
        Ok(())
    }

    /// Takes stretches of the log's time, s: the n-th from with the n-th to; a last to may be missing.
    ///
    /// # Errors
    /// More ends than beginnings, an end before its beginning.
    pub fn between(&mut self, from: &[f64], to: &[f64]) -> Result<(), FixError> {
        if to.len() > from.len().max(1) || from.len() > to.len() + 1 {
            return Err(FixError(format!(
                "--from is given {} times and --to {} times: a stretch has both, the last may lack its --to",
                from.len(),
                to.len()
            )));
        }
        for i in 0..from.len().max(to.len()) {
            let begin = from.get(i).copied().unwrap_or(f64::NEG_INFINITY);
            let end = to.get(i).copied().unwrap_or(f64::INFINITY);
            if begin.is_nan() || end.is_nan() || begin >= end {
                return Err(FixError(format!(
                    "--from {begin} --to {end}: the end is not after the beginning"
                )));
            }
            self.stretches.push((begin, end));
        }
        Ok(())
    }

    /// Whether what is given can all be true for the noise model, in which gain_i = (K_d + K_nms)*a_i: K_d and one
    /// a_i with its gain say each other, and so do two a_i without K_d. A wheel above a bar takes a log whose rows are near enough.
    ///
    /// # Errors
    /// What contradicts what, or could.
    pub fn check(&self, log: &DriveLog) -> Result<(), FixError> {
        if self.wheel_inertia.is_some() && log.dt_s > 1.01 * LONGEST_WHEEL_ROW_S {
            return Err(FixError(format!(
                "--wheel-inertia: the log has {:.0} rows a second, {:.0} are wanted, for the wheel's acceleration is made of them",
                1.0 / log.dt_s,
                1.0 / LONGEST_WHEEL_ROW_S
            )));
        }
        let of_wheel = [
            ("wheel_damping", self.wheel_damping),
            ("bar_stiffness", self.bar_stiffness),
        ];
        if let Some((name, _)) = of_wheel.iter().find(|(_, value)| value.is_some())
            && self.wheel_inertia.is_none()
        {
            return Err(FixError(format!(
                "--fix {name}: --wheel-inertia is wanted beside it, or --fix wheel_inertia: without one no wheel turns above a torsion bar"
            )));
        }
        let given: Vec<usize> = (0..3).filter(|&i| self.a[i].is_some()).collect();
        if let Some(i) = (0..3).find(|&i| self.a[i].is_some() && self.gain[i].is_some() && self.k_d.is_some())
        {
            return Err(FixError(format!(
                "--fix: a_{n}, gain_{n} and k_d are too many, for gain_{n} = (k_d + k_nms)*a_{n}",
                n = i + 1
            )));
        }
        if self.k_d.is_none()
            && let [first, second, ..] = given[..]
        {
            return Err(FixError(format!(
                "--fix: a_{} and a_{} need k_d beside them: each alone gives k_d",
                first + 1,
                second + 1
            )));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_lands_in_its_place_and_a_bad_one_is_named() {
        let mut o = Options::default();
        for fix in ["k_d=3.5", "A_2 = 0.02", "gain_3=15", "t_nms=0.12"] {
            o.fix(fix).unwrap();
        }
        assert_eq!(
            (o.k_d, o.a[1], o.gain[2], o.muscle.t_nms_s),
            (Some(3.5), Some(0.02), Some(15.0), 0.12)
        );
        for (fix, says) in [
            ("k_d", "NAME=VALUE"),
            ("K_x=1", "k_x: unknown"),
            ("k_hg=1.5", "k_hg: 1.5 is outside 0 to 1"),
            ("t_p=soon", "\"soon\" is not a number"),
            ("t_p=NaN", "NaN is outside"),
            ("k_d=0", "k_d: 0 is outside 0.1 to 20"),
            ("gain_2=-0.1", "gain_2: -0.1 is outside 0 to 10"),
        ] {
            let e = o.fix(fix).unwrap_err().to_string();
            assert!(e.contains(says), "{e}");
        }
    }

    #[test]
    fn a_wheel_has_an_inertia_or_it_is_sought() {
        for (text, inertia, is) in [
            ("0.001", 0.001, Inertia::About),
            ("0.2", 0.2, Inertia::About),
            ("estimate", USUAL_INERTIA_KG_M2, Inertia::Sought),
        ] {
            let mut o = Options::default();
            o.take_inertia(text).unwrap();
            assert_eq!((o.wheel_inertia, o.wheel_inertia_is), (Some(inertia), is));
        }
        let [by_hand, fixed] = [(true, None), (false, Some("wheel_inertia=0.04".to_owned()))]
            .map(|(manual, fix)| Options::given(manual, &Vec::from_iter(fix)).unwrap());
        let mut late = Options::default();
        late.estimate("t_h_late").unwrap();
        for (mut o, text, says) in [
            (
                Options::default(),
                "0.0009",
                "0.0009: 0.001 to 0.2 kg.m2 or \"estimate\" is wanted",
            ),
            (Options::default(), "0.21", "0.21: 0.001 to 0.2"),
            (Options::default(), "NaN", "NaN: 0.001 to 0.2"),
            (Options::default(), "guess", "guess: 0.001 to 0.2"),
            (by_hand, "estimate", "a --manual drive has no guidance torque"),
            (late, "estimate", "the probe tells the one or the other"),
            (fixed.clone(), "0.04", "--fix wheel_inertia is given too"),
            (fixed, "estimate", "--fix wheel_inertia is given too"),
        ] {
            let e = o.take_inertia(text).unwrap_err().to_string();
            assert!(e.starts_with("--wheel-inertia ") && e.contains(says), "{e}");
        }
    }

    #[test]
    fn what_is_to_be_estimated_has_a_range_and_a_stretch_two_ends() {
        let mut o = Options::default();
        o.estimate("t_nms=0.12..0.2").unwrap();
        o.estimate("T_d_late").unwrap();
        assert_eq!(o.estimate, [None, Some([0.12, 0.2]), None, Some([-0.1, 0.2])]);
        assert_eq!(o.muscle.t_nms_s, 0.12);
        for (what, says) in [
            ("a_1", "one of k_nms, t_nms"),
            ("t_nms=0.1", "LOW..HIGH"),
            ("t_nms=0.2..0.1", "within 0.02 to 0.5"),
            ("k_nms=0..20", "within 0 to 10"),
        ] {
            let e = o.estimate(what).unwrap_err().to_string();
            assert!(e.contains(says), "{e}");
        }
        o.between(&[10.0, 50.0], &[20.0]).unwrap();
        assert_eq!(o.stretches, [(10.0, 20.0), (50.0, f64::INFINITY)]);
        assert!(
            o.between(&[10.0], &[9.0])
                .unwrap_err()
                .to_string()
                .contains("not after")
        );
        assert!(
            o.between(&[1.0, 2.0, 3.0], &[9.0])
                .unwrap_err()
                .to_string()
                .contains("3 times")
        );
    }

    #[test]
    fn a_name_given_twice_and_the_k_hg_of_a_manual_drive_are_refused() {
        let given = |manual, fixes: &[&str]| {
            let fixes: Vec<String> = fixes.iter().map(|&f| f.to_owned()).collect();
            Options::given(manual, &fixes)
        };
        let error = given(false, &["k_d=3", "k_nms=1", " K_D =4"]).unwrap_err();
        assert!(error.to_string().contains("k_d is given twice"), "{error}");
        let error = given(true, &["k_hg=0.2"]).unwrap_err();
        assert!(
            error.to_string().contains("a --manual drive has no k_hg"),
            "{error}"
        );
        let options = given(false, &["k_d=3", "k_hg=0.2"]).unwrap();
        assert_eq!(
            (options.manual, options.k_d, options.k_hg),
            (false, Some(3.0), Some(0.2))
        );
    }

    #[test]
    fn what_says_the_same_thing_twice_is_refused() {
        for (fixes, says) in [
            (
                &["a_2=0.1", "k_d=3", "gain_2=0.4"][..],
                Some("a_2, gain_2 and k_d are too many"),
            ),
            (&["a_1=0.1", "a_3=3.7"], Some("a_1 and a_3 need k_d")),
            (&["a_1=0.1", "a_3=3.7", "k_d=3"], None),
            (&["a_1=0.1", "gain_1=0.4"], None),
            (&["a_1=0.1", "gain_2=0.4", "k_d=3"], None),
            (
                &["wheel_damping=0.05"],
                Some("--wheel-inertia is wanted beside it"),
            ),
            (
                &["bar_stiffness=143"],
                Some("--wheel-inertia is wanted beside it"),
            ),
            (&["wheel_inertia=0.04"], Some("25 rows a second, 40 are wanted")),
        ] {
            let mut o = Options::default();
            for fix in fixes {
                o.fix(fix).unwrap();
            }
            let slow = DriveLog {
                dt_s: 0.04,
                ..DriveLog::default()
            };
            match (o.check(&slow), says) {
                (Ok(()), None) => {}
                (Err(e), Some(says)) => assert!(e.to_string().contains(says), "{e}"),
                (got, _) => panic!("{fixes:?}: {got:?}"),
            }
        }
    }
}
