//! The curves of a course, and the stretches without guidance, as shaded stretches of a figure over the road.

use crate::plot::{Band, Shade};
use haptic_sim::models::road::Course;
use haptic_sim::unguided::Unguided;

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
                shade: if dark { Shade::Dark } else { Shade::Light },
                panel: None,
            });
        }
        from = to;
    }
    bands
}

/// Stretches of a run without guidance, with why.
pub(super) fn unguided(stretches: &[Unguided]) -> impl Iterator<Item = Band> {
    stretches.iter().map(|stretch| Band {
        label: format!("no guidance: {}", stretch.why),
        from: stretch.from_m,
        to: stretch.to_m,
        shade: Shade::Alert,
        panel: None,
    })
}
