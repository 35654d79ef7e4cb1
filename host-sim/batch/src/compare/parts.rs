//! The laws and drivers that a file names, with their parameters.

use haptic_sim::input::InputError;
use haptic_sim::kind::{Kind, Make};
use toml::{Table, Value};

use super::Chosen;
use crate::files::Source;
use crate::study::check_names;

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
