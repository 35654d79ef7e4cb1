//! Values along a road: cubic polynomials, each valid from its own start to the next one's.

use roxmltree::Node;

use super::error::{RoadError, refuse};
use super::xml::{cubic, number};

/// One cubic polynomial of the distance from `start_m`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Cubic {
    pub(super) start_m: f64,
    pub(super) factors: [f64; 4],
}

impl Cubic {
    /// Value, slope and second derivative.
    pub(super) fn at(&self, s_m: f64) -> [f64; 3] {
        let [a, b, c, d] = self.factors;
        let ds = s_m - self.start_m;
        [
            a + ds * (b + ds * (c + ds * d)),
            b + ds * (2.0 * c + ds * 3.0 * d),
            2.0 * c + 6.0 * d * ds,
        ]
    }
}

/// The polynomials in order of their starts; zero before the first.
#[derive(Debug, Clone, Default)]
pub(super) struct Profile(pub(super) Vec<Cubic>);

impl Profile {
    /// Reads elements whose start is the attribute `start`, counted from `origin_m`.
    ///
    /// # Errors
    /// A number missing or broken, starts that do not ascend.
    pub(super) fn read<'a>(
        nodes: impl Iterator<Item = Node<'a, 'a>>,
        start: &str,
        origin_m: f64,
        place: &str,
    ) -> Result<Self, RoadError> {
        let mut cubics: Vec<Cubic> = Vec::new();
        for node in nodes {
            let start_m = origin_m + number(node, start, place)?;
            if cubics.last().is_some_and(|last| start_m < last.start_m) {
                let element = node.tag_name().name();
                return refuse(format!(
                    "{place}: the <{element}> elements are not in ascending order of {start}"
                ));
            }
            cubics.push(Cubic {
                start_m,
                factors: cubic(node, "", place)?,
            });
        }
        Ok(Self(cubics))
    }

    /// The polynomial that is valid at a place.
    pub(super) fn piece_at(&self, s_m: f64) -> Cubic {
        let after = self.0.partition_point(|cubic| cubic.start_m <= s_m);
        after
            .checked_sub(1)
            .map_or(Cubic::default(), |index| self.0[index])
    }

    /// Where one polynomial hands over to the next.
    pub(super) fn starts_m(&self) -> impl Iterator<Item = f64> {
        self.0.iter().map(|cubic| cubic.start_m)
    }
}
