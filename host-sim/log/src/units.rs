//! Units as files write them, and the factors between those of one quantity.

/// Quantity, a writing of its unit, and how many SI units it is.
const UNITS: &[(&str, &str, f64)] = &[
    ("torque", "nm", 1.0),
    ("torque", "mnm", 1e-3),
    ("torque", "cnm", 1e-2),
    ("torque", "knm", 1e3),
    ("torque", "lbft", 1.355_817_948_331_400_4),
    ("angle", "rad", 1.0),
    ("angle", "mrad", 1e-3),
    ("angle", "deg", std::f64::consts::PI / 180.0),
    ("angle", "gon", std::f64::consts::PI / 200.0),
    ("angle", "turn", std::f64::consts::TAU),
    ("length", "m", 1.0),
    ("length", "cm", 1e-2),
    ("length", "mm", 1e-3),
    ("length", "km", 1e3),
    ("length", "ft", 0.3048),
    ("length", "in", 0.0254),
    ("time", "h", 3600.0),
    ("time", "min", 60.0),
    ("time", "s", 1.0),
    ("time", "ms", 1e-3),
    ("time", "us", 1e-6),
    ("time", "ns", 1e-9),
    ("speed", "m/s", 1.0),
    ("speed", "km/h", 1.0 / 3.6),
    ("speed", "mph", 0.44704),
    ("speed", "kn", 1852.0 / 3600.0),
    ("speed", "ft/s", 0.3048),
    ("angular rate", "rad/s", 1.0),
    ("angular rate", "deg/s", std::f64::consts::PI / 180.0),
    ("angular rate", "rpm", std::f64::consts::PI / 30.0),
    ("curvature", "1/m", 1.0),
    ("curvature", "1/km", 1e-3),
    ("none", "1", 1.0),
];

/// The last part of a name that has its unit there, as this project's channels have, and the unit.
const ENDINGS: &[(&str, &str)] = &[
    ("_rad_per_s", "rad/s"),
    ("_deg_per_s", "deg/s"),
    ("_m_per_s", "m/s"),
    ("_kmh", "km/h"),
    ("_1pm", "1/m"),
    ("_rad", "rad"),
    ("_deg", "deg"),
    ("_mnm", "mN.m"),
    ("_nm", "N.m"),
    ("_mm", "mm"),
    ("_ms", "ms"),
    ("_us", "us"),
    ("_m", "m"),
    ("_s", "s"),
];

fn found(unit: &str) -> Option<(&'static str, f64)> {
    // Capitals are of no account but here: a mega is no milli.
    if unit.starts_with("MN") {
        return None;
    }
    let plain: String = unit
        .to_lowercase()
        .replace('°', "deg")
        .replace("degrees", "deg")
        .replace("degree", "deg")
        .replace(['·', '*', '.', '-', ' ', '⋅'], "")
        .replace("m^1", "1/m")
        .replace('µ', "u");
    let plain = match plain.as_str() {
        "kph" | "kmh" => "km/h",
        "newtonmeter" | "newtonmetre" => "nm",
        "radian" | "radians" => "rad",
        "lbfft" | "ftlbf" | "ftlb" => "lbft",
        "rev" | "turns" => "turn",
        "inch" => "in",
        "mi/h" => "mph",
        "1/min" | "rev/min" => "rpm",
        "minute" | "minutes" => "min",
        "hour" | "hours" => "h",
        "knot" | "knots" => "kn",
        "sec" | "second" | "seconds" => "s",
        "metre" | "meter" => "m",
        other => other,
    };
    UNITS
        .iter()
        .find(|(_, name, _)| *name == plain)
        .map(|(quantity, _, si)| (*quantity, *si))
}

/// What a value in `from` is to be multiplied by to be one in `to`; none if they are not of one quantity, or not known.
///
/// ```
/// use haptic_log::units::factor;
/// assert_eq!(factor("mm", "m"), Some(1e-3));
/// assert_eq!(factor("Nm", "N.m"), Some(1.0));
/// assert_eq!(factor("V", "N.m"), None);
/// assert_eq!(factor("MN.m", "N.m"), None);
/// assert_eq!(factor("lbf-ft", "N.m"), Some(1.3558179483314004));
/// ```
#[must_use]
pub fn factor(from: &str, to: &str) -> Option<f64> {
    if from == to {
        return Some(1.0);
    }
    let ((quantity, from), (wanted, to)) = (found(from)?, found(to)?);
    (quantity == wanted).then_some(from / to)
}

/// Whether a unit is one of those that are converted.
#[must_use]
pub fn is_known(unit: &str) -> bool {
    found(unit).is_some()
}

/// A name and the unit in brackets behind it: `Speed [km/h]`, `T_d (Nm)`.
#[must_use]
pub fn in_brackets(text: &str) -> Option<(&str, &str)> {
    let split = |open: char, close: char| -> Option<(&str, &str)> {
        let (name, unit) = text.trim().strip_suffix(close)?.rsplit_once(open)?;
        (!name.trim().is_empty()).then_some((name.trim(), unit.trim()))
    };
    split('[', ']').or_else(|| split('(', ')'))
}

/// A name without the unit in brackets behind it.
#[must_use]
pub fn bare(name: &str) -> &str {
    in_brackets(name).map_or(name, |(name, _)| name)
}

/// The unit that a name ends with, if it does.
#[must_use]
pub fn of_name(name: &str) -> Option<&'static str> {
    let lower = name.to_ascii_lowercase();
    ENDINGS
        .iter()
        .find(|(ending, _)| lower.ends_with(ending))
        .map(|(_, unit)| *unit)
}
