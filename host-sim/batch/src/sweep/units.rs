//! The unit of a varied field: what the reference's table of fields says, which a test holds against the code
//! (`cargo test -p host-sim --test file_fields`).

use super::axis::Column;

const FIELDS: &str = include_str!("../../../../docs/files.md");

/// The unit of a column's values, `-` if that is 1; none if they are not its fields' values, or the fields have several.
pub(super) fn of(column: &Column) -> Option<String> {
    if column.times != 1.0 || column.over.is_some() {
        return None;
    }
    let mut units = column.paths.iter().map(|path| of_field(path));
    let first = units.next()??;
    units.all(|unit| unit == Some(first)).then(|| first.into())
}

fn of_field(path: &str) -> Option<&'static str> {
    // A course's own fields stand in a table without its name, a segment's without its place.
    let named: Vec<&str> = path
        .split('.')
        .filter(|part| *part != "course" && part.parse::<usize>().is_err())
        .collect();
    let spelt = |name: &str| name.replace('_', "").to_lowercase();
    let wanted = spelt(&named.join("."));
    let mut rows = FIELDS
        .lines()
        .filter_map(|line| line.strip_prefix("| `")?.split_once("` | "));
    let (_, rest) = rows.find(|(field, _)| spelt(field) == wanted)?;
    match rest.split('|').next()?.trim() {
        "" => Some("-"),
        unit => Some(unit),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_has_the_unit_of_the_reference() {
        for (path, unit) in [
            ("speed", Some("km/h")),
            ("driver.t_p", Some("s")),
            ("driver.K_hg", Some("-")),
            ("vehicle.B_s", Some("N.m.s/rad")),
            ("course.segment.2.curvature_end", Some("1/m")),
            ("course.lane_width", Some("m")),
            ("no.such", None),
        ] {
            assert_eq!(of_field(path), unit, "{path}");
        }
        let column = |paths: &[&str], times| Column {
            name: "own".into(),
            paths: paths.iter().map(|path| (*path).into()).collect(),
            times,
            over: None,
        };
        assert_eq!(
            of(&column(&["driver.t_p", "driver.t_nms"], 1.0)).as_deref(),
            Some("s")
        );
        assert_eq!(of(&column(&["driver.t_p", "driver.K_d"], 1.0)), None, "two units");
        assert_eq!(
            of(&column(&["failure.time"], 3.6)),
            None,
            "a number of the user's own"
        );
    }
}
