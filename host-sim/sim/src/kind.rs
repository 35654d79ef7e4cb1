//! Laws and drivers by name: what a study file chooses from, and how one of your own joins.
//!
//! A [`Kind`] is a name, its source, its parameters with defaults and ranges, and a function that makes the part. A part may be made
//! around another one: a limit around a law, a habit around a driver.

use crate::input::{RangeError, in_range};
use crate::scenario::{Scenario, ScenarioError};

/// Where a kind or a default comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// The source of the kind has it.
    Published,
    /// The source has it in part; what it leaves open, or what differs, was chosen here.
    After,
    /// It was chosen here.
    Ours,
}

/// A number that a kind of law or driver takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Its name in a file, with the unit where it has one.
    pub name: &'static str,
    /// Its value if a file says nothing.
    pub default: f64,
    /// The least and the largest value allowed.
    pub range: [f64; 2],
    /// Where the default comes from.
    pub origin: Origin,
    /// The least and the largest value that tuning tries; none if it leaves the parameter alone.
    pub tuned: Option<[f64; 2]>,
}

impl Parameter {
    /// A parameter whose default is published.
    pub const fn published(name: &'static str, default: f64, range: [f64; 2]) -> Self {
        Self {
            name,
            default,
            range,
            origin: Origin::Published,
            tuned: None,
        }
    }

    /// A parameter whose default was chosen here.
    pub const fn ours(name: &'static str, default: f64, range: [f64; 2]) -> Self {
        Self {
            origin: Origin::Ours,
            ..Self::published(name, default, range)
        }
    }

    /// The parameter as one which tuning varies between two values.
    #[must_use]
    pub const fn tuned(self, low: f64, high: f64) -> Self {
        Self {
            tuned: Some([low, high]),
            ..self
        }
    }

    /// Whether a value may be chosen.
    ///
    /// # Errors
    /// The parameter, the value and its range.
    pub fn check(&self, value: f64) -> Result<(), RangeError> {
        in_range(self.name, value, self.range[0]..=self.range[1], "")
    }
}

/// A function that makes a part, as [`Make::Part`] has one.
pub type MakeGiven<P> = dyn Fn(&Scenario, &[f64]) -> Result<Box<P>, ScenarioError> + Send + Sync;

/// How a part is made of a scenario and of the values of its kind's parameters, in their order.
pub enum Make<P: ?Sized + 'static> {
    /// By itself.
    Part(fn(&Scenario, &[f64]) -> Result<Box<P>, ScenarioError>),
    /// By itself, by a function with a memory of its own: what another language brings.
    Given(&'static MakeGiven<P>),
    /// Around another one.
    Around(fn(&Scenario, &[f64], Box<P>) -> Box<P>),
}

/// A kind of law or driver.
pub struct Kind<P: ?Sized + 'static> {
    /// Its name in a file.
    pub name: &'static str,
    /// Where it is published, or whose it is.
    pub source: &'static str,
    /// How much of its equation the source has.
    pub origin: Origin,
    /// What it takes.
    pub parameters: &'static [Parameter],
    /// How it is made.
    pub make: Make<P>,
}

impl<P: ?Sized> Kind<P> {
    /// The defaults of its parameters.
    pub fn defaults(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.default).collect()
    }

    /// Its source in words; "after" where some of the equation was chosen here.
    pub fn said_source(&self) -> String {
        match self.origin {
            Origin::After => format!("after {}", self.source),
            Origin::Published | Origin::Ours => self.source.to_owned(),
        }
    }
}
