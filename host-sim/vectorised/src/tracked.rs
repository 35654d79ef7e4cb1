//! Points of several runs on their roads: [`Centreline::project`] for one point of each run at once, to the same bits.
//!
//! Every run keeps a copy of the cell that its point is in, so that the search reads from its own place and not from
//! all over a table. A search that does not end soon, or that leaves the road, is given up: its run is suspect.

use std::sync::Arc;

use super::lanes::lanes;
use super::{ALIVE, Aligned, either};
use haptic_sim::models::road::{
    CONVERGED_M, Centreline, FORTIETH, MIN_DETERMINANT, OVERRUN_M, SIXTH, Shape, Tracker,
};

/// Steps of a search, of which one or two are the rule.
const MOST_STEPS: usize = 4;

lanes! {
    /// One point of each run.
    pub(super) struct Tracked {
        /// Arc lengths found.
        pub(super) s: f64 = 0.0,
        advance: f64 = 0.0,
        /// Ends of the cell.
        low: f64 = 0.0,
        high: f64 = 0.0,
        middle: f64 = 0.0,
        x: f64 = 0.0,
        y: f64 = 0.0,
        tangent_x: f64 = 0.0,
        tangent_y: f64 = 0.0,
        heading: f64 = 0.0,
        curvature: f64 = 0.0,
        slope: f64 = 0.0,
        square_over_6: f64 = 0.0,
        cube_over_24: f64 = 0.0,
        /// Largest arc length that a search may end at.
        end: f64 = 0.0,
        /// What was found, as a [`haptic_sim::models::road::Projection`] has it.
        pub(super) offset: f64 = 0.0,
        pub(super) found_heading: f64 = 0.0,
        pub(super) found_curvature: f64 = 0.0,
        cell: usize = 0,
    } beside {
        /// The shape of the cell of each point, and the most bent of them.
        shapes: [u8; N] = [STRAIGHT; N],
        shape: u8 = STRAIGHT,
    }
}

/// What of a projection is kept.
pub(super) const OFFSET: u8 = 1;
pub(super) const HEADING: u8 = 2;
pub(super) const ALL: u8 = 7;
const CURVATURE: u8 = 4;

const STRAIGHT: u8 = Shape::Straight as u8;
const ARC: u8 = Shape::Arc as u8;
const CLOTHOID: u8 = Shape::Clothoid as u8;

impl<const N: usize> Tracked<N> {
    /// Where a point was found last.
    pub(super) fn place(&self, lane: usize) -> Tracker {
        Tracker {
            cell: self.cell[lane],
            s_m: self.s[lane],
            advance_m: self.advance[lane],
        }
    }

    /// A new run begins in a lane.
    pub(super) fn begin(&mut self, lane: usize, road: &Centreline, tracker: &Tracker) {
        self.clear(lane);
        (self.s[lane], self.advance[lane]) = (tracker.s_m, tracker.advance_m);
        self.end[lane] = road.length_m() + OVERRUN_M;
        self.enter(lane, road, tracker.cell);
    }

    fn enter(&mut self, lane: usize, road: &Centreline, index: usize) {
        let Some(cell) = road.cells().get(index) else {
            return;
        };
        self.cell[lane] = index;
        [self.low[lane], self.high[lane]] = cell.ends_m;
        self.middle[lane] = cell.s_m;
        (self.x[lane], self.y[lane]) = (cell.x_m, cell.y_m);
        [self.tangent_x[lane], self.tangent_y[lane]] = cell.tangent;
        self.heading[lane] = cell.heading_rad;
        // A negative zero becomes a positive one, as the straight's own formula has it.
        self.curvature[lane] = cell.curvature_1pm + 0.0;
        self.slope[lane] = cell.curvature_slope_1pm2 + 0.0;
        [self.square_over_6[lane], self.cube_over_24[lane]] = cell.curvature_powers;
        let shape = cell.shape as u8;
        if shape != self.shapes[lane] {
            self.shapes[lane] = shape;
            self.shape = self.shapes.iter().fold(STRAIGHT, |most, shape| most.max(*shape));
        }
    }

    /// Walks to the cells that the searches which left theirs are in now.
    #[cold]
    #[inline(never)]
    fn walk(&mut self, roads: &[Arc<Centreline>; N], at: &[f64; N], outside: &[u64; N]) {
        for lane in 0..N {
            if outside[lane] != ALIVE {
                continue;
            }
            let index = roads[lane].walk(self.cell[lane], at[lane]);
            if index != self.cell[lane] {
                self.enter(lane, &roads[lane], index);
            }
        }
    }

    /// Projects a point of each run that is selected; returns which of them found no foot. `longer` is the time since the
    /// last look over the time between the last two.
    #[inline(always)]
    pub(super) fn project<const KEPT: u8>(
        &mut self,
        roads: &[Arc<Centreline>; N],
        px: &[f64; N],
        py: &[f64; N],
        selected: &[u64; N],
        longer: &[f64; N],
    ) -> [u64; N] {
        let mut places = Aligned(([0.0; N], [0; N]));
        let (at, outside) = (&mut places.0.0, &mut places.0.1);
        let mut open = *selected;
        for l in 0..N {
            at[l] = self.s[l] + self.advance[l] * longer[l];
        }
        for _ in 0..MOST_STEPS {
            let mut is_any_outside = 0;
            for l in 0..N {
                let is_outside = (at[l] > self.high[l]) | (at[l] < self.low[l]);
                outside[l] = if is_outside { open[l] } else { 0 };
                is_any_outside |= outside[l];
            }
            if is_any_outside != 0 {
                self.walk(roads, at, outside);
            }
            let left = match self.shape {
                STRAIGHT => self.search::<STRAIGHT, KEPT>(px, py, at, &mut open),
                ARC => self.search::<ARC, KEPT>(px, py, at, &mut open),
                _ => self.search::<CLOTHOID, KEPT>(px, py, at, &mut open),
            };
            if left == 0 {
                break;
            }
        }
        open
    }

    /// One step of every search that is open; returns whether any still is. A shape's formula is that of the next one
    /// without the terms that vanish, to the same bits.
    #[inline(always)]
    fn search<const SHAPE: u8, const KEPT: u8>(
        &mut self,
        px: &[f64; N],
        py: &[f64; N],
        at: &mut [f64; N],
        open: &mut [u64; N],
    ) -> u64 {
        let mut left = 0;
        for l in 0..N {
            let sigma = at[l] - self.middle[l];
            let (k0, k1) = (self.curvature[l], self.slope[l]);
            let (tx, ty) = (self.tangent_x[l], self.tangent_y[l]);
            let (dx, dy) = (px[l] - self.x[l], py[l] - self.y[l]);
            let sigma2 = sigma * sigma;
            let (theta, along, across, curvature) = match SHAPE {
                STRAIGHT => (sigma * 0.0, sigma, 0.0, 0.0),
                ARC => (
                    sigma * k0,
                    sigma - sigma2 * sigma * self.square_over_6[l],
                    sigma2 * (0.5 * k0 - self.cube_over_24[l] * sigma2),
                    k0,
                ),
                _ => (
                    sigma * (k0 + 0.5 * k1 * sigma),
                    sigma
                        - sigma2
                            * sigma
                            * (self.square_over_6[l] + k1 * sigma * (k0 / 8.0 + k1 * sigma * FORTIETH)),
                    sigma2 * (0.5 * k0 + k1 * sigma * SIXTH - self.cube_over_24[l] * sigma2),
                    k0 + k1 * sigma,
                ),
            };
            let (cos, sin) = match SHAPE {
                STRAIGHT => (1.0, 0.0),
                _ => (1.0 - 0.5 * theta * theta, theta - theta * theta * theta * SIXTH),
            };
            let (ahead, left_of) = (dx * tx + dy * ty - along, dy * tx - dx * ty - across);
            let distance = ahead * cos + left_of * sin;
            let offset = left_of * cos - ahead * sin;
            let determinant = 1.0 - curvature * offset;
            // Without curvature the determinant is one.
            let step = if SHAPE == STRAIGHT {
                distance
            } else {
                distance / determinant
            };
            let s = at[l] + step;
            let is_sound = (determinant >= MIN_DETERMINANT) & (s >= -OVERRUN_M) & (s <= self.end[l]);
            let is_found = is_sound & (step.abs() < CONVERGED_M);
            let take = if is_found { open[l] } else { 0 };
            self.advance[l] = either(take, s - self.s[l], self.advance[l]);
            self.s[l] = either(take, s, self.s[l]);
            if KEPT & OFFSET != 0 {
                self.offset[l] = either(take, offset, self.offset[l]);
            }
            if KEPT & HEADING != 0 {
                let heading = self.heading[l] + theta + curvature * step;
                self.found_heading[l] = either(take, heading, self.found_heading[l]);
            }
            if KEPT & CURVATURE != 0 {
                self.found_curvature[l] = either(take, curvature, self.found_curvature[l]);
            }
            // What is not sound stays open for ever.
            at[l] = if is_sound { s } else { f64::NAN };
            open[l] &= !take;
            left |= open[l];
        }
        left
    }
}
