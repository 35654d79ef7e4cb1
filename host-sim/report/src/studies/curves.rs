//! The curves of a course as shaded stretches of a figure.

use crate::plot::Band;
use haptic_sim::models::road::Course;

/// Clothoids in the lighter shade, arcs in the darker; straights stay white.
pub(super) fn bands(course: &Course) -> Vec<Band> {
    let mut from = 0.0;
    let mut bands = Vec::new();
    for segment in course.segments() {
        let to = from + segment.length_m;
        let (start, end) = (segment.curvature_start_1pm, segment.curvature_end_1pm);
        if start != 0.0 || end != 0.0 {
            let dark = start == end;
            let label = if dark { "arc" } else { "clothoid" };
            bands.push(Band {
                label: label.into(),
                from,
                to,
                dark,
            });
        }
        from = to;
    }
    bands
}
