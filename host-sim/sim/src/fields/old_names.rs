//! What a field of an older file is called.

use super::{Field, suffix};

/// Names that older files have, where they are not the name without its unit or had another unit: table, old name, new name, old unit, and how much of the new unit that is.
const OLD_NAMES: [(&str, &str, &str, &str, f64); 18] = [
    ("", "lane_width", "lane_width_m", "", 1.0),
    ("", "speed", "speed_m_per_s", "km/h", 1.0 / 3.6),
    ("speed", "kmh", "speed_m_per_s", "km/h", 1.0 / 3.6),
    ("speed", "time", "time_s", "", 1.0),
    ("speed", "place", "place_m", "", 1.0),
    ("world", "friction_give", "friction_give_rad", "deg", DEG),
    ("world", "assist_speed", "assist_speed_m_per_s", "km/h", 1.0 / 3.6),
    ("sensor_errors", "angle_bias", "angle_bias_rad", "deg", DEG),
    (
        "sensor_errors",
        "yaw_rate_bias",
        "yaw_rate_bias_rad_per_s",
        "mrad/s",
        1e-3,
    ),
    (
        "sensor_errors",
        "yaw_rate_noise",
        "yaw_rate_noise_rad_per_s",
        "mrad/s",
        1e-3,
    ),
    (
        "sensor_errors",
        "heading_noise",
        "heading_noise_rad",
        "mrad",
        1e-3,
    ),
    ("sensor_errors", "camera_yaw", "camera_yaw_rad", "mrad", 1e-3),
    (
        "sensor_errors",
        "dropouts",
        "dropout_rate_per_s",
        "1/h",
        1.0 / 3600.0,
    ),
    ("sensor_errors", "dropout", "dropout_duration_s", "", 1.0),
    (
        "sensor_errors",
        "line_jumps",
        "line_jump_rate_per_s",
        "1/h",
        1.0 / 3600.0,
    ),
    ("tolerances", "angle_bias", "angle_bias_rad", "deg", DEG),
    ("tolerances", "camera_yaw", "camera_yaw_rad", "mrad", 1e-3),
    (
        "tolerances",
        "yaw_rate_bias",
        "yaw_rate_bias_rad_per_s",
        "mrad/s",
        1e-3,
    ),
];
const DEG: f64 = std::f64::consts::PI / 180.0;

/// A name without its unit.
fn stem<'a>(name: &'a str, unit: &str) -> &'a str {
    let bare = name
        .strip_suffix(&suffix(unit))
        .map(|bare| bare.strip_suffix('_').unwrap_or(bare));
    bare.filter(|_| !unit.is_empty()).unwrap_or(name)
}

/// What the first field is called that a text calls by an old name; `known` are the fields of a table.
pub(crate) fn old_name(text: &str, known: impl Fn(&str) -> Vec<&'static Field>) -> Option<String> {
    let file: toml::Table = toml::from_str(text).ok()?;
    let in_table = |table: &str, name: &str, value: &toml::Value| {
        let full = |name: &str| format!("{table}{}{name}", if table.is_empty() { "" } else { "." });
        let listed = OLD_NAMES
            .iter()
            .find(|old| old.0 == table && old.1 == name && !value.is_table());
        if let Some((_, _, new, unit, factor)) = listed {
            let converted = match value.as_float().or(value.as_integer().map(|whole| whole as f64)) {
                _ if unit.is_empty() => String::new(),
                Some(value) => format!(": {value} {unit} are {}", value * factor),
                None => format!(": 1 {unit} is {factor}"),
            };
            return Some(format!("{} is called {new}{converted}", full(name)));
        }
        let spelt = |name: &str| name.replace('_', "").to_lowercase();
        let fields = known(table);
        let same = |field: &&&Field| spelt(stem(field.name, field.unit)) == spelt(name);
        let field = fields.iter().find(same).filter(|field| field.name != name)?;
        Some(format!("{} is called {}", full(name), field.name))
    };
    let in_tables = |name: &str, tables: &[toml::Value]| {
        let mut fields = tables.iter().filter_map(toml::Value::as_table).flatten();
        fields.find_map(|(field, value)| in_table(name, field, value))
    };
    file.iter().find_map(|(name, value)| {
        // The segments of a course stand in its own file, or in a scenario's table `[course]`.
        let course = if name == "segment" {
            Some(value)
        } else {
            value.get("segment")
        };
        let segments = course.and_then(toml::Value::as_array);
        in_table("", name, value)
            .or_else(|| in_tables(name, std::slice::from_ref(value)))
            .or_else(|| in_tables("segment", segments?))
    })
}

#[cfg(test)]
mod tests {
    use crate::Scenario;
    use crate::input::InputError;
    use crate::models::road::Course;

    /// The name, and the number in the unit of today where that was another.
    #[test]
    fn an_old_name_is_refused_with_the_new_one_and_its_unit() {
        for (text, expected) in [
            (
                "speed = 72",
                "s.toml: speed is called speed_m_per_s: 72 km/h are 20",
            ),
            (
                "[speed]\ntime = [0, 9]\nkmh = [60, 60]",
                "speed.kmh is called speed_m_per_s: 1 km/h is 0.27777",
            ),
            ("driver.t_p = 0.3", "driver.t_p is called t_p_s"),
            (
                "[driver]\nmanual_K_d = 4",
                "driver.manual_K_d is called manual_k_d_nm_per_rad",
            ),
            ("[driver]\na_1 = 0.1", "driver.a_1 is called a_1_rad_per_m"),
            ("[guidance]\na_1 = 2", "guidance.a_1 is called a_1_per_m"),
            ("[vehicle]\nI = 3000", "vehicle.I is called i_kg_m2"),
            ("[vehicle]\nK_t = 0.06", "vehicle.K_t is called k_t"),
            (
                "[world]\nfriction_give = 1",
                "world.friction_give is called friction_give_rad: 1 deg are 0.0174532925",
            ),
            (
                "[sensor_errors]\ncamera_yaw = 2",
                "sensor_errors.camera_yaw is called camera_yaw_rad: 2 mrad are 0.002",
            ),
            (
                "[sensor_errors]\ndropouts = 720",
                "sensor_errors.dropouts is called dropout_rate_per_s: 720 1/h are 0.2",
            ),
            (
                "[sensor_errors]\ndropout = 1",
                "sensor_errors.dropout is called dropout_duration_s",
            ),
            (
                "[failure]\nkind = 'torque'\ntime = 40",
                "failure.time is called time_s",
            ),
        ] {
            let none = |name: &str, _: &_| Err(InputError::new(name, "not there"));
            let error = Scenario::from_toml("s.toml", text, none).unwrap_err().to_string();
            assert!(error.contains(expected), "{text:?} gave {error:?}");
        }
    }

    #[test]
    fn an_old_name_in_a_course_is_refused_with_the_new_one() {
        for (text, expected) in [
            ("lane_width = 3.5", "lane_width is called lane_width_m"),
            ("[[segment]]\nlength = 9", "segment.length is called length_m"),
            (
                "[[segment]]\nlength_m = 9\ncurvature_start = 0\ncurvature_end = 0",
                "segment.curvature_end is called curvature_end_per_m",
            ),
            (
                "[[segment]]\nlength_m = 9\nbank = 0.1",
                "segment.bank is called bank_rad",
            ),
        ] {
            let error = Course::from_toml("c.toml", text).unwrap_err().to_string();
            assert_eq!(error, format!("c.toml: {expected}"));
            let course = format!("[course]\nname = 'c'\n{}", text.replace("[[", "[[course."));
            let none = |name: &str, _: &_| Err(InputError::new(name, "not there"));
            let error = Scenario::from_toml("s.toml", &course, none)
                .unwrap_err()
                .to_string();
            assert!(
                error.ends_with(expected.trim_start_matches("lane_width ")),
                "{error}"
            );
        }
    }
}
