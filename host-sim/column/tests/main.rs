//! Tests of the column with a torsion bar, one file per theme.

mod curve;
mod drive;
mod faults;
mod hands;
mod peers;
mod physics;
mod studies;
