//! Tests of the observer, one file per theme.

mod limits;
mod oracle;
