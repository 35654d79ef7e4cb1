//! Names the commit that the program is built from. Outside git it is `unknown`.

use std::process::Command;

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    (output.status.success() && !text.trim().is_empty()).then(|| text.trim().to_owned())
}

fn main() {
    let commit = git(&["describe", "--always", "--exclude=*", "--abbrev=12", "--dirty"]);
    println!(
        "cargo::rustc-env=HAPTIC_COMMIT={}",
        commit.as_deref().unwrap_or("unknown")
    );
    // The log of HEAD grows with every commit; the sources decide whether they differ from it.
    let log = git(&["rev-parse", "--git-path", "logs/HEAD"]);
    for path in log
        .as_deref()
        .into_iter()
        .chain(["..", "../../core/src", "../../Cargo.lock"])
    {
        println!("cargo::rerun-if-changed={path}");
    }
}
