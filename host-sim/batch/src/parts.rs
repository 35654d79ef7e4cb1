//! The laws and drivers that a file names, with their parameters.

use haptic_sim::drivers::{AnyDriver, DRIVERS, HABITS};
use haptic_sim::input::InputError;
use haptic_sim::kind::{Kind, Make, Parameter};
use haptic_sim::laws::{LAWS, Law};
use haptic_sim::models::driver::ArmGains;
use haptic_sim::participants::participants;
use haptic_sim::scenario::{Scenario, ScenarioError};
use toml::{Table, Value};

use crate::engine::StudyError;
use crate::files::{Source, check_names};
use crate::path;

/// The laws, drivers and habits that a file may name.
pub struct Kinds {
    /// Laws, and what may be put around one.
    pub laws: Vec<Kind<dyn Law>>,
    /// Drivers, and habits.
    pub drivers: Vec<Kind<dyn AnyDriver>>,
}

impl Default for Kinds {
    fn default() -> Self {
        Self {
            laws: LAWS.into_iter().chain([path::KIND]).collect(),
            drivers: DRIVERS.into_iter().chain(HABITS).collect(),
        }
    }
}

/// A law or driver of a file.
pub struct Chosen<'k, P: ?Sized + 'static> {
    /// Its name in the file.
    pub name: String,
    /// What it is.
    pub kind: &'k Kind<P>,
    /// The values of its parameters; `None` is the default, which tuning may leave.
    pub values: Vec<Option<f64>>,
    /// What is around it, the innermost first, with the values of their parameters.
    pub around: Vec<(&'k Kind<P>, Vec<f64>)>,
}

impl<'k, P: ?Sized> Chosen<'k, P> {
    /// A kind by its name, with its defaults.
    ///
    /// # Errors
    /// There is no such kind that stands by itself.
    pub fn named(kinds: &'k [Kind<P>], name: &str) -> Result<Self, StudyError> {
        let by_itself = |kind: &&Kind<P>| !matches!(kind.make, Make::Around(_));
        let found = kinds.iter().filter(by_itself).find(|kind| kind.name == name);
        let known = kinds.iter().filter(by_itself).map(|kind| kind.name);
        let kind = found.ok_or_else(|| unknown("kind", name, known))?;
        Ok(Self {
            name: name.into(),
            kind,
            values: vec![None; kind.parameters.len()],
            around: Vec::new(),
        })
    }

    /// The part for a scenario, untuned.
    ///
    /// # Errors
    /// As [`haptic_sim::scenario::ScenarioBuilder::build`] for a driver's parameters.
    pub fn untuned_part(&self, scenario: &Scenario) -> Result<Box<P>, ScenarioError> {
        self.make(scenario, &self.untuned())
    }

    /// The values of its parameters, untuned.
    pub fn untuned(&self) -> Vec<f64> {
        let pairs = self.values.iter().zip(self.kind.parameters);
        pairs.map(|(value, p)| value.unwrap_or(p.default)).collect()
    }

    /// Its kind in what is around it.
    pub(crate) fn kinds(&self) -> String {
        let around = self.around.iter().map(|(outer, _)| outer.name);
        around.fold(self.kind.name.to_owned(), |inner, outer| {
            format!("{outer}({inner})")
        })
    }

    /// This choice with other values of some parameters of what is around it.
    pub(crate) fn with_habit(&self, kind: &str, changed: &[(&str, f64)]) -> Self {
        let value = |p: &Parameter, value: &f64| {
            let found = changed.iter().find(|(name, _)| *name == p.name);
            found.map_or(*value, |(_, value)| *value)
        };
        let outer = |(outer, values): &(&'k Kind<P>, Vec<f64>)| {
            let values = outer.parameters.iter().zip(values);
            let all = values.map(|(p, old)| if outer.name == kind { value(p, old) } else { *old });
            (*outer, all.collect())
        };
        Self {
            name: self.name.clone(),
            kind: self.kind,
            values: self.values.clone(),
            around: self.around.iter().map(outer).collect(),
        }
    }

    /// Makes it untuned; what is refused is named as the file names it.
    pub(crate) fn check(
        &self,
        what: &str,
        source: &Source,
        scenario: &Scenario,
    ) -> Result<Box<P>, InputError> {
        let made = self.untuned_part(scenario);
        made.map_err(|e| source.bad(format!("{what} {}: {e}", self.name)))
    }

    pub(crate) fn make(&self, scenario: &Scenario, values: &[f64]) -> Result<Box<P>, ScenarioError> {
        let mut made = match self.kind.make {
            Make::Part(make) => make(scenario, values)?,
            Make::Given(make) => make(scenario, values)?,
            // The file was checked: what goes around another one is in `around`.
            Make::Around(_) => unreachable!("{} is made around another one", self.kind.name),
        };
        for (kind, values) in &self.around {
            if let Make::Around(make) = kind.make {
                made = make(scenario, values, made);
            }
        }
        Ok(made)
    }
}

impl<'k> Chosen<'k, dyn AnyDriver> {
    /// The driver as he drives without guidance, who has other gains than with it, and the table of Wang et al. that has them; none of a
    /// kind that is published with one set.
    pub(crate) fn by_hand(&self, kinds: &'k [Kind<dyn AnyDriver>]) -> Option<(Self, &'static str)> {
        let untuned = self.untuned();
        let (values, table) = match (self.kind.name, &untuned[..]) {
            ("participant", [number]) | ("adapting", [number, ..]) => {
                let own = participants()
                    .into_iter()
                    .find(|p| f64::from(p.number) == number.round())?
                    .manual;
                (vec![own.a_1, own.a_2, own.a_3, own.t_p, own.k_d, 0.0], "table 5")
            }
            ("paper", [a_1, a_2, a_3, t_p, ..]) => {
                (vec![*a_1, *a_2, *a_3, *t_p, ArmGains::MANUAL.k_d, 0.0], "table 4")
            }
            _ => return None,
        };
        let by_hand = Self {
            name: self.name.clone(),
            kind: kinds.iter().find(|kind| kind.name == "paper")?,
            values: values.into_iter().map(Some).collect(),
            around: self.around.clone(),
        };
        Some((by_hand, table))
    }

    /// The share of his guided gains with which a driver who adapts begins, and over how many days he follows; none of one who does not.
    pub(crate) fn adapts(&self) -> Option<[f64; 2]> {
        match (self.kind.name, &self.untuned()[..]) {
            ("adapting", [_, share, days]) => Some([*share, *days]),
            _ => None,
        }
    }

    /// A driver who adapts, with a share of his guided gains.
    pub(crate) fn with_share(
        &self,
        scenario: &Scenario,
        share: f64,
    ) -> Result<Box<dyn AnyDriver>, ScenarioError> {
        let mut values = self.untuned();
        values[1] = share;
        self.make(scenario, &values)
    }
}

/// What a file's laws or drivers are.
pub(crate) fn parts<'k, P: ?Sized>(
    source: &Source,
    what: &str,
    tables: &[Table],
    kinds: &'k [Kind<P>],
) -> Result<Vec<Chosen<'k, P>>, InputError> {
    let chosen = tables.iter().map(|table| part(source, what, table, kinds));
    let chosen = chosen.collect::<Result<Vec<_>, _>>()?;
    check_names(source, what, chosen.iter().map(|c| &c.name))?;
    Ok(chosen)
}

fn part<'k, P: ?Sized>(
    source: &Source,
    what: &str,
    table: &Table,
    kinds: &'k [Kind<P>],
) -> Result<Chosen<'k, P>, InputError> {
    let mut table = table.clone();
    let kind = kind_of(source, what, &mut table, kinds, false)?;
    let name = match table.remove("name") {
        None => kind.name.to_owned(),
        Some(Value::String(name)) => name,
        Some(other) => return Err(source.bad(format!("{what}.name = {other}: a text is wanted"))),
    };
    let here = format!("{what} {name}");
    let mut around = Vec::new();
    match table.remove("around") {
        None => {}
        Some(Value::Array(outer)) => {
            for outer in outer {
                let Value::Table(mut outer) = outer else {
                    return Err(
                        source.bad(format!("{here}: around = {outer}: tables with a kind are wanted"))
                    );
                };
                let kind = kind_of(source, &format!("{here}: around"), &mut outer, kinds, true)?;
                let values = values(source, &format!("{here}: {}", kind.name), &outer, kind)?;
                let values = values
                    .into_iter()
                    .zip(kind.parameters)
                    .map(|(value, p)| value.unwrap_or(p.default));
                around.push((kind, values.collect()));
            }
        }
        Some(other) => {
            return Err(source.bad(format!("{here}: around = {other}: a list of tables is wanted")));
        }
    }
    let values = values(source, &here, &table, kind)?;
    Ok(Chosen {
        name,
        kind,
        values,
        around,
    })
}

/// The kind that a table names; with `outer` one that goes around another.
fn kind_of<'k, P: ?Sized>(
    source: &Source,
    here: &str,
    table: &mut Table,
    kinds: &'k [Kind<P>],
    outer: bool,
) -> Result<&'k Kind<P>, InputError> {
    let fits = |kind: &&Kind<P>| matches!(kind.make, Make::Around(_)) == outer;
    let name = match table.remove("kind") {
        Some(Value::String(name)) => name,
        Some(other) => other.to_string(),
        None => String::new(),
    };
    let known = || kinds.iter().filter(fits).map(|kind| kind.name);
    let found = kinds.iter().filter(fits).find(|kind| kind.name == name);
    found.ok_or_else(|| source.bad(unknown(&format!("{here}.kind"), &name, known())))
}

/// The values that a table gives the parameters of a kind.
fn values<P: ?Sized>(
    source: &Source,
    here: &str,
    table: &Table,
    kind: &Kind<P>,
) -> Result<Vec<Option<f64>>, InputError> {
    let mut values = vec![None; kind.parameters.len()];
    for (name, value) in table {
        let place = kind.parameters.iter().position(|p| p.name == name);
        let known = || kind.parameters.iter().map(|p| p.name);
        let place = place.ok_or_else(|| source.bad(unknown(here, name, known())))?;
        let number = value
            .as_float()
            .or_else(|| value.as_integer().map(|whole| whole as f64));
        let number =
            number.ok_or_else(|| source.bad(format!("{here}: {name} = {value}: a number is wanted")))?;
        kind.parameters[place]
            .check(number)
            .map_err(|e| source.bad(e.within(here)))?;
        values[place] = Some(number);
    }
    Ok(values)
}

/// What is said of a name that is not known.
pub(crate) fn unknown(field: &str, name: &str, known: impl Iterator<Item = &'static str>) -> String {
    format!(
        "{field}: there is no {name:?}, only {}",
        known.collect::<Vec<_>>().join(", ")
    )
}
