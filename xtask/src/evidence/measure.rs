//! Making a measurement: the program of evidence, in parts that an interruption leaves behind.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use serde::Deserialize;
use serde_json::Value;

use super::kept::{Campaign, Cell, Earlier, Kept, Numbers, Origin, Row, Same};
use super::list::{List, Measurement, Rule, Seeds};
use super::{PROGRAM, all_kept, document, kept_in, replace, stale};
use crate::built::Built;
use crate::tool::{Usage, command, output, root};

/// What a person wants other than the list has it.
pub(super) struct Asked<'a> {
    pub(super) seeds: Option<u64>,
    pub(super) hours: Option<f64>,
    pub(super) again: Option<&'a str>,
}

impl Asked<'_> {
    /// How much is run.
    fn count(&self, rule: Rule) -> Rule {
        match rule {
            Rule::Seeds(seeds) => Rule::Seeds(self.seeds.unwrap_or(seeds)),
            Rule::Hours(hours) => Rule::Hours(self.hours.unwrap_or(hours)),
        }
    }
}

/// Rows of the campaign that run at once: what an interruption costs at most.
const AT_ONCE: usize = 16;

/// Makes measurements one after the other; each is kept, and shown by the documents, as soon as it is done.
pub(super) fn all(list: &List, names: &[String], asked: &Asked) -> Result<()> {
    let wanted = || names.iter().map(|name| (name, &list.measurement[name]));
    if let Some(hours) = asked.hours.filter(|hours| !(*hours > 0.0 && hours.is_finite())) {
        return Err(Usage(format!("--hours {hours}: more than 0 are needed")).into());
    }
    let uses = |asked: bool, is: fn(&Rule) -> bool| !asked || wanted().any(|(_, m)| is(&m.rule));
    let used = [
        (
            "--seeds",
            uses(asked.seeds.is_some(), |rule| matches!(rule, Rule::Seeds(_))),
        ),
        (
            "--hours",
            uses(asked.hours.is_some(), |rule| matches!(rule, Rule::Hours(_))),
        ),
    ];
    if let Some((option, _)) = used.iter().find(|(_, is_used)| !is_used) {
        return Err(Usage(format!("{option}: none of {} ends by it", names.join(", "))).into());
    }
    let commit = clean_commit()?;
    // Before there is work behind any.
    for (name, measurement) in wanted() {
        earlier(list, name, measurement, asked)?;
    }
    let program = Built::ToShip.evidence()?;
    for (number, (name, measurement)) in (1..).zip(wanted()) {
        println!("== {name} ({number} of {})", names.len());
        let earlier = earlier(list, name, measurement, asked)?;
        let count = asked.count(measurement.rule);
        let first_seed = list.first_seed(measurement);
        let run = Run {
            program: &program,
            commit: &commit,
            arguments: measurement.arguments(count, first_seed),
            parts: parts_in(name, &commit, count),
        };
        let numbers = match measurement.rule {
            Rule::Seeds(_) => {
                let (rows, limit) = run.campaign()?;
                Numbers::Campaign(Campaign::new(rows, limit, measurement.keeps))
            }
            Rule::Hours(_) => Numbers::Availability(run.availability()?),
        };
        ensure!(
            clean_commit()? == commit,
            "there is another commit now: nothing of {name} is kept"
        );
        let date = output(command("git").args(["show", "-s", "--format=%cs", &commit]))?;
        let origin = Origin {
            command: format!("{PROGRAM} {}", run.arguments),
            commit: commit.clone(),
            date: date.trim().into(),
            rule: measurement.rule,
            count,
            first_seed,
            held_out: measurement.seeds == Seeds::HeldOut,
            earlier,
            same: None,
        };
        let path = kept_in(name);
        fs::create_dir_all(path.parent().unwrap_or(root()))?;
        replace(&path, &Kept { origin, numbers }.to_text()?)?;
        document::write(list, &all_kept(list)?)?;
        fs::remove_dir_all(&run.parts).with_context(|| run.parts.display().to_string())?;
    }
    Ok(())
}

/// Looks whether today's code gives the same results as the code that measurements were made with, in the first twentieth of
/// their runs: then a figure is not older than today's code, though it was measured before. `then` is the program of that code.
pub(super) fn same(list: &List, names: &[String], then: &Path) -> Result<()> {
    let commit = clean_commit()?;
    let today = Built::ToShip.evidence()?;
    for (number, name) in (1..).zip(names) {
        println!("== {name} ({number} of {})", names.len());
        let mut kept = Kept::read(&kept_in(name))?;
        let measurement = &list.measurement[name];
        let count = match measurement.rule {
            Rule::Seeds(seeds) => Rule::Seeds(seeds.div_ceil(20)),
            Rule::Hours(hours) => Rule::Hours(hours / 20.0),
        };
        let lines = |program: &Path, commit: &str| {
            let run = Run {
                program,
                commit,
                arguments: measurement.arguments(count, kept.origin.first_seed),
                parts: parts_in(name, commit, count),
            };
            let lines = run.lines(measurement.rule)?;
            fs::remove_dir_all(&run.parts).with_context(|| run.parts.display().to_string())?;
            Ok::<_, anyhow::Error>(lines)
        };
        let [then, now] = [lines(then, kept.origin.holds_at())?, lines(&today, &commit)?];
        if let Some((then, now)) = then.iter().zip(&now).find(|(then, now)| !are_alike(then, now)) {
            bail!("{name} has to be measured again. It was\n{then}\nand is\n{now}");
        }
        ensure!(
            then.len() == now.len(),
            "{name} has to be measured again: it has other rows"
        );
        kept.origin.same = Some(Same {
            commit: commit.clone(),
            count,
        });
        replace(&kept_in(name), &kept.to_text()?)?;
        document::write(list, &all_kept(list)?)?;
    }
    Ok(())
}

/// Whether two results are the same to nine digits, which is more than any document shows: another order of a sum changes the
/// last ones.
fn are_alike(then: &Value, now: &Value) -> bool {
    match (then, now) {
        (Value::Number(then), Value::Number(now)) => {
            let [then, now] = [then, now].map(|number| number.as_f64().unwrap_or(f64::NAN));
            (then - now).abs() <= 1e-9 * then.abs().max(1.0)
        }
        (Value::Array(then), Value::Array(now)) => {
            then.len() == now.len() && then.iter().zip(now).all(|(then, now)| are_alike(then, now))
        }
        (Value::Object(then), Value::Object(now)) => {
            let mut pairs = then.iter().zip(now);
            then.len() == now.len() && pairs.all(|((a, then), (b, now))| a == b && are_alike(then, now))
        }
        _ => then == now,
    }
}

/// The commit of a tree that does not differ from it but in the documents, which this command writes.
fn clean_commit() -> Result<String> {
    let differing = output(command("git").args(["status", "--porcelain", "--", ".", ":!docs"]))?;
    ensure!(
        differing.is_empty(),
        "a figure needs its commit; commit first, or take away:\n{differing}"
    );
    Ok(output(command("git").args(["rev-parse", "HEAD"]))?.trim().into())
}

/// Where the parts of a measurement lie until it is whole.
fn parts_in(name: &str, commit: &str, count: Rule) -> PathBuf {
    let count = count.to_string().replace(' ', "-");
    root().join(format!("target/evidence/{name}-{}-{count}", &commit[..12]))
}

/// Earlier uses of the seeds of a measurement.
///
/// # Errors
/// They are held out, and were used by other code or for another number of runs. Who sees a result and then changes either
/// judges by seeds that are no longer held out.
fn earlier(list: &List, name: &str, measurement: &Measurement, asked: &Asked) -> Result<Vec<Earlier>> {
    if measurement.seeds != Seeds::HeldOut {
        return Ok(Vec::new());
    }
    let mut kept: BTreeMap<String, Origin> = all_kept(list)?
        .into_iter()
        .map(|(name, kept)| (name, kept.origin))
        .collect();
    kept.retain(|_, origin| origin.first_seed == list.held_out_from);
    let mut used = BTreeMap::new();
    for (of, origin) in &kept {
        let is_other = !stale::is_known(origin.holds_at())
            || !stale::changed(origin.holds_at(), &list.measurement[of].judged)?.is_empty();
        used.insert(of.as_str(), (origin, is_other));
    }
    uses(name, asked.count(measurement.rule), asked.again, &used)
}

/// By name, where held-out seeds were used, and whether the code was other than now.
fn uses(
    name: &str,
    count: Rule,
    again: Option<&str>,
    used: &BTreeMap<&str, (&Origin, bool)>,
) -> Result<Vec<Earlier>> {
    let is_another =
        |of: &str, origin: &Origin, is_other: bool| is_other || (of == name && origin.count != count);
    let mut others = used
        .iter()
        .filter(|(of, (origin, is_other))| is_another(of, origin, *is_other));
    let own = used.get(name).map(|(own, _)| own.earlier.clone());
    let mut earlier = own.unwrap_or_default();
    let Some(again) = again else {
        if let Some((of, (origin, is_other))) = others.next() {
            let commit = &origin.commit[..12];
            let how = match is_other {
                true => format!("{of} at {commit}, when the code was another"),
                false => format!("{of} at {commit} with {}", origin.count),
            };
            bail!(Usage(format!(
                "{name}: its seeds are held out and were used by {how}. Set held_out_from to a seed that was never used, or say why \
                 in --again; the documents then say it"
            )));
        }
        return Ok(earlier);
    };
    for (_, (origin, _)) in others {
        let use_ = Earlier {
            commit: origin.commit.clone(),
            count: origin.count,
            again: again.into(),
        };
        if !earlier.contains(&use_) {
            earlier.push(use_);
        }
    }
    Ok(earlier)
}

/// One measurement under way.
struct Run<'a> {
    program: &'a Path,
    commit: &'a str,
    arguments: String,
    parts: PathBuf,
}

/// What `--json` says beside its numbers.
#[derive(Deserialize)]
struct Provenance {
    commit: String,
}

/// A campaign, or some rows of it.
#[derive(Deserialize)]
struct Part {
    rows: Vec<Row>,
    limits: Limits,
    provenance: Provenance,
}

#[derive(Deserialize)]
struct Limits {
    left_lane: Option<f64>,
}

#[derive(Deserialize)]
struct Drives {
    cells: Vec<Cell>,
    together: Vec<Cell>,
    provenance: Provenance,
}

impl Run<'_> {
    /// Every row that runs there, some at a time: they do not depend on each other.
    fn campaign(&self) -> Result<(Vec<Row>, Option<f64>)> {
        let table = output(command(self.program).args(["faults", "--list"]))?;
        let has_bar = self.arguments.contains("--world bar");
        let names = rows_of(&table, self.arguments.contains("--target"), has_bar);
        ensure!(!names.is_empty(), "{PROGRAM} faults --list has no rows");
        let (mut rows, mut limit) = (Vec::new(), None);
        for (k, some) in names.chunks(AT_ONCE).enumerate() {
            println!(
                "rows {} to {} of {}",
                rows.len() + 1,
                rows.len() + some.len(),
                names.len()
            );
            let text = self.part(&format!("{k}.json"), &["--rows", &some.join(",")])?;
            let part: Part = serde_json::from_str(&text).context("cargo xtask faults --json")?;
            self.is_of_commit(&part.provenance)?;
            rows.extend(part.rows);
            limit = part.limits.left_lane;
        }
        Ok((rows, limit))
    }

    /// Its drives go on from a checkpoint.
    fn availability(&self) -> Result<Vec<Cell>> {
        let drives = self.parts.join("drives.jsonl");
        let text = self.part("all.json", &["--checkpoint", &drives.to_string_lossy()])?;
        let drives: Drives = serde_json::from_str(&text).context("cargo xtask availability --json")?;
        self.is_of_commit(&drives.provenance)?;
        Ok(drives.cells.into_iter().chain(drives.together).collect())
    }

    /// Its results, a line each.
    fn lines(&self, rule: Rule) -> Result<Vec<Value>> {
        let lines: serde_json::Result<Vec<Value>> = match rule {
            Rule::Seeds(_) => self.campaign()?.0.iter().map(serde_json::to_value).collect(),
            Rule::Hours(_) => self.availability()?.iter().map(serde_json::to_value).collect(),
        };
        Ok(lines?)
    }

    /// What the program prints, or printed before an interruption.
    fn part(&self, file: &str, more: &[&str]) -> Result<String> {
        fs::create_dir_all(&self.parts)?;
        let path = self.parts.join(file);
        if let Ok(text) = fs::read_to_string(&path) {
            return Ok(text);
        }
        let mut run = command(self.program);
        run.args(self.arguments.split(' ')).args(more).arg("--json");
        let said = run.stderr(std::process::Stdio::inherit()).output();
        let said = said.with_context(|| self.arguments.clone())?;
        // 1: something failed, which is a result.
        ensure!(
            matches!(said.status.code(), Some(0 | 1)),
            "{PROGRAM} {}: {}",
            self.arguments,
            said.status
        );
        let text = String::from_utf8(said.stdout)?;
        replace(&path, &text)?;
        Ok(text)
    }

    /// A program that was built before the commit, or a part of another one, is no evidence.
    fn is_of_commit(&self, provenance: &Provenance) -> Result<()> {
        // Documents that differ make it dirty; nothing else does, as was looked at.
        let built = provenance.commit.trim_end_matches("-dirty");
        ensure!(
            self.commit.starts_with(built),
            "the program was built from {built}, not from {}",
            self.commit
        );
        Ok(())
    }
}

/// Names of the rows that run on the host, or of those that run in QEMU too, in a world whose column has a bar or has none.
fn rows_of(table: &str, on_target: bool, has_bar: bool) -> Vec<String> {
    let another = if has_bar {
        ", without a bar"
    } else {
        ", with a bar"
    };
    let row = |line: &str| {
        let name = line.strip_prefix("| `")?.split_once('`')?.0;
        let place = line.strip_suffix(" |")?.rsplit_once("| ")?.1;
        let runs = place.starts_with("host, Q") || (!on_target && place.starts_with("host"));
        (runs && !place.ends_with(another)).then(|| name.to_owned())
    };
    table.lines().filter_map(row).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use serde_json::json;

    use super::super::kept::Origin;
    use super::super::list::Rule;
    use super::{are_alike, rows_of, uses};

    #[test]
    fn results_are_alike_to_nine_digits_and_in_every_count() {
        let row = |noticed: u32, deviation_m: f64| json!({"noticed": noticed, "after_ms": [7, null], "deviation_m": deviation_m});
        let then = row(14, 1.349_577_207_018_047_2);
        assert!(
            are_alike(&then, &row(14, 1.349_577_207_018_066)) && are_alike(&then, &row(14, 1.349_577_208))
        );
        for other in [
            row(15, 1.349_577_207),
            row(14, 1.349_577_21),
            json!({"noticed": 14}),
            json!([14]),
        ] {
            assert!(!are_alike(&then, &other), "{other}");
        }
    }

    /// What the uses of held-out seeds allow to "relying" with so many of them, and what is then said of earlier ones.
    fn said(of: &str, is_other: bool, seeds: u64, again: Option<&str>) -> Result<Vec<String>, String> {
        let origin = Origin {
            command: String::new(),
            commit: "0123456789abcdef".into(),
            date: String::new(),
            rule: Rule::Seeds(200),
            count: Rule::Seeds(200),
            first_seed: 77,
            held_out: true,
            earlier: Vec::new(),
            same: None,
        };
        let used = BTreeMap::from([(of, (&origin, is_other))]);
        let earlier = uses("relying", Rule::Seeds(seeds), again, &used).map_err(|e| e.to_string())?;
        Ok(earlier
            .into_iter()
            .map(|one| format!("{} {}", one.commit, one.again))
            .collect())
    }

    #[test]
    fn held_out_seeds_are_used_by_one_state_of_the_code_and_for_one_count() {
        assert_eq!(said("relying", false, 200, None), Ok(Vec::new()));
        assert_eq!(said("paper", false, 100, None), Ok(Vec::new()));
        let error = said("paper", true, 200, None).unwrap_err();
        assert!(
            error.contains("by paper at 0123456789ab, when the code was another"),
            "{error}"
        );
        let error = said("relying", false, 100, None).unwrap_err();
        assert!(
            error.contains("by relying at 0123456789ab with 200 seeds"),
            "{error}"
        );
        for (of, is_other, seeds) in [
            ("paper", true, 200),
            ("relying", true, 200),
            ("relying", false, 100),
        ] {
            assert_eq!(
                said(of, is_other, seeds, Some("why")),
                Ok(vec!["0123456789abcdef why".to_owned()])
            );
        }
    }

    #[test]
    fn rows_run_where_the_table_says() {
        let table = "### Bus\n\n| fault | what | where |\n|---|---|---|\n| `a` | x | host |\n| `b` | x | host, Q |\n| `c` | x | Q |\n\
                     | `d` | x | host, with a bar |\n| `e` | x | host, Q, without a bar |\n";
        assert_eq!(rows_of(table, false, false), ["a", "b", "e"]);
        assert_eq!(rows_of(table, false, true), ["a", "b", "d"]);
        assert_eq!(rows_of(table, true, false), ["b", "e"]);
    }
}
