//! What the law and the user want to know of the parts of others: notices of their licences, and a bill of materials.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde_json::{Value, json};

use super::archive::Entry;
use crate::tool::{cargo, command, output, root};

/// Name and version.
type Crate = (String, String);

/// What the command line's reports carry beside crates: name, version, licence, and the file of its text.
const ASSETS: [(&str, &str, &str, &str); 2] = [
    ("uPlot", "1.6.32", "MIT", "host-sim/report/assets/uplot/LICENSE"),
    (
        "DejaVu Sans",
        "2.37",
        "Bitstream-Vera",
        "host-sim/report/assets/LICENSE-DejaVu.txt",
    ),
];

/// Licences, notices and bill of materials of packages built for a target; the first gives the bill its name.
pub(crate) fn of(packages: &[&str], features: &str, target: &str) -> Result<Vec<Entry>> {
    let package = *packages.first().context("no package")?;
    let linked = linked(packages, features, target)?;
    let metadata = output(
        cargo()
            .args("metadata --format-version 1 --locked --filter-platform".split(' '))
            .arg(target),
    )?;
    let metadata: Value = serde_json::from_str(&metadata).context("cargo metadata")?;
    let all = metadata["packages"].as_array().context("packages")?;
    let parts: Vec<&Value> = all
        .iter()
        .filter(|part| linked.contains(&name_of(part)))
        .collect();
    let has_assets = linked.iter().any(|(name, _)| name == "haptic-report");
    let assets = if has_assets { ASSETS.as_slice() } else { &[] };
    let mut entries = vec![
        Entry::read(&root().join("LICENSE-MIT"), "LICENSE-MIT")?,
        Entry::read(&root().join("LICENSE-APACHE"), "LICENSE-APACHE")?,
        Entry::new("NOTICES.txt", notices(&parts, assets)?),
        Entry::new("sbom.cdx.json", bill(package, &parts, &metadata, assets)?),
    ];
    // Every part holds a piece of Rust's own library. A toolchain without documents has not the file.
    let sysroot = output(command("rustc").args(["--print", "sysroot"]))?;
    let library = Path::new(sysroot.trim()).join("share/doc/rust/COPYRIGHT-library.html");
    if library.is_file() {
        entries.push(Entry::read(&library, "LICENSES-rust-library.html")?);
    }
    Ok(entries)
}

/// The crates that are linked, not those that only help to compile.
fn linked(packages: &[&str], features: &str, target: &str) -> Result<BTreeSet<Crate>> {
    let said = output(
        cargo()
            .args("tree --locked -e normal,no-proc-macro --prefix none -f {p}".split(' '))
            .args(packages.iter().flat_map(|package| ["-p", package]))
            .args(["--features", features, "--target", target]),
    )?;
    let crates = said.lines().filter_map(|line| {
        let mut words = line.split(' ');
        Some((
            words.next()?.to_owned(),
            words.next()?.strip_prefix('v')?.to_owned(),
        ))
    });
    Ok(crates.collect())
}

fn name_of(part: &Value) -> Crate {
    let word = |key: &str| part[key].as_str().unwrap_or_default().to_owned();
    (word("name"), word("version"))
}

/// A licence as SPDX writes it: older packages have a slash for "or".
fn licence(part: &Value) -> String {
    part["license"]
        .as_str()
        .unwrap_or("NOASSERTION")
        .replace('/', " OR ")
}

fn is_ours(part: &Value) -> bool {
    part["source"].is_null()
}

/// A list of the parts of others, and each text once, under the names of those it comes from.
fn notices(parts: &[&Value], assets: &[(&str, &str, &str, &str)]) -> Result<String> {
    let mut list = String::from("Parts of others, with their licences. The texts follow.\n\n");
    let mut texts: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for part in parts.iter().filter(|part| !is_ours(part)) {
        let (name, version) = name_of(part);
        let name = format!("{name} {version}");
        let files = licence_files(part)?;
        let missing = if files.is_empty() {
            "; its package has no text"
        } else {
            ""
        };
        list += &format!("{name}: {}{missing}\n", licence(part));
        for file in files {
            let bytes = fs::read(&file).with_context(|| file.display().to_string())?;
            let text = String::from_utf8_lossy(&bytes).replace('\r', "");
            texts
                .entry(text.trim_end().to_owned())
                .or_default()
                .push(name.clone());
        }
    }
    for (name, version, licence, file) in assets {
        list += &format!("{name} {version}: {licence}\n");
        let text = fs::read_to_string(root().join(file)).with_context(|| (*file).to_owned())?;
        texts.entry(text).or_default().push((*name).to_owned());
    }
    let rule = "-".repeat(80);
    for (text, names) in texts {
        list += &format!("\n{rule}\n{}\n{rule}\n\n{text}\n", names.join(", "));
    }
    Ok(list)
}

/// The files of a package that hold a licence or a notice.
fn licence_files(part: &Value) -> Result<Vec<PathBuf>> {
    let manifest = Path::new(part["manifest_path"].as_str().context("a manifest")?);
    let folder = manifest.parent().context("a folder")?;
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let file = entry?.path();
        let name = file.file_name().unwrap_or_default().to_ascii_uppercase();
        let name = name.to_string_lossy();
        let begins = [
            "LICENSE",
            "LICENCE",
            "COPYING",
            "COPYRIGHT",
            "NOTICE",
            "UNLICENSE",
        ];
        if file.is_file() && begins.iter().any(|begin| name.starts_with(begin)) {
            files.push(file);
        }
    }
    files.sort();
    Ok(files)
}

/// CycloneDX 1.5. cargo-cyclonedx writes the paths of the machine into it, and so no two the same.
fn bill(
    package: &str,
    parts: &[&Value],
    metadata: &Value,
    assets: &[(&str, &str, &str, &str)],
) -> Result<String> {
    let sums = checksums()?;
    let reference = |part: &Value| {
        let (name, version) = name_of(part);
        format!("pkg:cargo/{name}@{version}")
    };
    let component = |part: &Value| {
        let (name, version) = name_of(part);
        let mut component = json!({
            "type": if name == package { "application" } else { "library" },
            "bom-ref": reference(part),
            "name": name,
            "version": version,
            "licenses": [{ "expression": licence(part) }],
        });
        if let Some(sum) = sums.get(&(name, version)) {
            component["purl"] = reference(part).into();
            component["hashes"] = json!([{ "alg": "SHA-256", "content": sum }]);
        }
        component
    };
    let (whole, others): (Vec<&Value>, Vec<&Value>) = parts
        .iter()
        .partition(|part| part["name"].as_str() == Some(package));
    let whole = *whole.first().with_context(|| format!("no package {package}"))?;
    let mut components: Vec<Value> = others.iter().map(|part| component(part)).collect();
    let rust = output(command("rustc").arg("--version"))?;
    let rust = rust.split(' ').nth(1).unwrap_or_default();
    components.push(json!({
        "type": "library", "bom-ref": "rust-std", "name": "Rust standard library", "version": rust,
        "licenses": [{ "expression": "MIT OR Apache-2.0" }],
    }));
    for (name, version, licence, _) in assets {
        components.push(json!({
            "type": "library", "bom-ref": name, "name": name, "version": version,
            "licenses": [{ "license": { "id": licence } }],
        }));
    }
    let by_id: BTreeMap<&str, &Value> = parts
        .iter()
        .filter_map(|part| Some((part["id"].as_str()?, *part)))
        .collect();
    let nodes = metadata["resolve"]["nodes"].as_array().context("no graph")?;
    let dependencies: Vec<Value> = nodes
        .iter()
        .filter_map(|node| Some((by_id.get(node["id"].as_str()?)?, node["dependencies"].as_array()?)))
        .map(|(part, uses)| {
            let uses = uses.iter().filter_map(|id| by_id.get(id.as_str()?));
            json!({ "ref": reference(part), "dependsOn": uses.map(|used| reference(used)).collect::<Vec<_>>() })
        })
        .collect();
    let mut about = json!({ "component": component(whole) });
    let time = [
        "log",
        "-1",
        "--date=format-local:%Y-%m-%dT%H:%M:%SZ",
        "--format=%cd",
    ];
    if let Ok(time) = output(command("git").env("TZ", "UTC").args(time)) {
        about["timestamp"] = time.trim().into();
    }
    let bill = json!({
        "$schema": "http://cyclonedx.org/schema/bom-1.5.schema.json",
        "bomFormat": "CycloneDX", "specVersion": "1.5", "version": 1,
        "metadata": about, "components": components, "dependencies": dependencies,
    });
    Ok(serde_json::to_string_pretty(&bill)? + "\n")
}

/// Checksums of the packages that came from a registry, as Cargo.lock holds them.
fn checksums() -> Result<BTreeMap<Crate, String>> {
    let text = fs::read_to_string(root().join("Cargo.lock")).context("Cargo.lock")?;
    let lock: toml::Table = text.parse().context("Cargo.lock")?;
    let packages = lock.get("package").and_then(toml::Value::as_array);
    let sums = packages.context("Cargo.lock")?.iter().filter_map(|package| {
        let word = |key: &str| Some(package.get(key)?.as_str()?.to_owned());
        Some(((word("name")?, word("version")?), word("checksum")?))
    });
    Ok(sums.collect())
}
