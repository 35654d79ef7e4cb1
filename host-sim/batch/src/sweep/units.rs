//! The unit of a varied field, from the lists of fields.

use haptic_sim::scenario::unit_of;

use super::axis::Column;

/// The unit of a column's values, `-` if that is 1; none if they are not its fields' values, or the fields have several.
pub(super) fn unit_of_column(column: &Column) -> Option<String> {
    if column.times != 1.0 || column.over.is_some() {
        return None;
    }
    let mut units = column.paths.iter().map(|path| unit_of(path));
    let first = units.next()??;
    let all = units.all(|unit| unit == Some(first));
    all.then(|| if first.is_empty() { "-" } else { first }.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_has_the_unit_of_the_reference() {
        let column = |paths: &[&str], times| Column {
            name: "own".into(),
            paths: paths.iter().map(|path| (*path).into()).collect(),
            times,
            over: None,
        };
        for (path, unit) in [
            ("speed_m_per_s", Some("m/s")),
            ("driver.t_p_s", Some("s")),
            ("driver.k_hg", Some("-")),
            ("vehicle.b_s_nms_per_rad", Some("N.m.s/rad")),
            ("course.segment.2.curvature_end_per_m", Some("1/m")),
            ("course.lane_width_m", Some("m")),
            ("no.such", None),
        ] {
            assert_eq!(unit_of_column(&column(&[path], 1.0)).as_deref(), unit, "{path}");
        }
        assert_eq!(
            unit_of_column(&column(&["driver.t_p_s", "driver.t_nms_s"], 1.0)).as_deref(),
            Some("s")
        );
        assert_eq!(
            unit_of_column(&column(&["driver.t_p_s", "driver.k_d_nm_per_rad"], 1.0)),
            None,
            "two units"
        );
        assert_eq!(
            unit_of_column(&column(&["failure.time_s"], 3.6)),
            None,
            "a number of the user's own"
        );
    }
}
