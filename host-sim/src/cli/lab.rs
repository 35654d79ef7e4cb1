//! `host-sim lab`: the page in the browser.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use clap::Args;
use haptic_pil::image::checkout;

use super::{BadInput, Outcome, print};

/// Where `cargo xtask web` leaves it, from a checkout.
const PAGE: &str = "target/dist/haptic-lab.html";

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// The page, if it is not target/dist/haptic-lab.html of the checkout that the working directory or this program lies in
    #[arg(value_name = "PAGE.html")]
    page: Option<PathBuf>,
    /// Print where the page is, and open nothing
    #[arg(long)]
    print: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let of_checkout = || checkout().map(|root| root.join(PAGE));
    let page = arguments.page.clone().or_else(of_checkout).ok_or_else(|| {
        format!("neither the working directory nor this program lies in a checkout of the repository: name the page, {PAGE} of one")
    })?;
    let page = page
        .canonicalize()
        .map_err(|e| format!("{}: {e}; `cargo xtask web` builds the page", page.display()))?;
    print(&page.display().to_string())?;
    if arguments.print {
        return Ok(Outcome::Good);
    }
    let (opener, first): (&str, &[&str]) = match std::env::consts::OS {
        "macos" => ("open", &[]),
        "windows" => ("cmd", &["/C", "start", ""]),
        _ => ("xdg-open", &[]),
    };
    match Command::new(opener)
        .args(first)
        .arg(&page)
        .stdout(Stdio::null())
        .status()
    {
        Ok(status) if status.success() => Ok(Outcome::Good),
        Ok(_) | Err(_) => Err(format!("{opener} did not open it: open the file in a browser").into()),
    }
}
