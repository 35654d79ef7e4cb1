//! `host-sim ecu run`: the ECU in QEMU, for clients on the clock of the wall.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use haptic_pil::bench::{Algorithm, Bench};

use super::super::{BadInput, Outcome, print};

#[derive(Debug, Args)]
pub(in crate::cli) struct Arguments {
    /// Where clients join the bus, by SLCAN: HOST:PORT; port 0 for any that is free
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:3333")]
    listen: String,
    /// Use only frames that are proven, by this MAC and the keys of the bench (docs/reference/bus.md, Authentication)
    #[arg(long, value_name = "MAC")]
    authenticate: Option<Mac>,
    /// End after so many seconds, 1 to 1e9; otherwise Ctrl-C ends it
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    r#for: Option<u64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Mac {
    #[value(name = "siphash")]
    SipHash,
    AesCmac,
}

impl From<Mac> for Algorithm {
    fn from(mac: Mac) -> Self {
        match mac {
            Mac::SipHash => Self::SipHash,
            Mac::AesCmac => Self::AesCmac,
        }
    }
}

/// Set by Ctrl-C, which is the usual end of it, and by a request to terminate: QEMU must not outlive this program.
static ENDED: AtomicBool = AtomicBool::new(false);

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    ctrlc::set_handler(|| ENDED.store(true, Ordering::Relaxed))?;
    let mut bench = Bench::start(&arguments.listen, arguments.authenticate.map(Algorithm::from))?;
    print(&format!(
        "the ECU is on the bus at {}; Ctrl-C ends it",
        bench.address()?
    ))?;
    let start = Instant::now();
    let limit = arguments.r#for.map(Duration::from_secs);
    let ended = || ENDED.load(Ordering::Relaxed) || limit.is_some_and(|limit| start.elapsed() >= limit);
    let mut longest = Duration::ZERO;
    let result = bench.run(ended, |behind| {
        longest = longest.max(behind);
        eprintln!(
            "(this host was busy: the ECU's clock waited {} ms)",
            behind.as_millis()
        );
    });
    if let Err(error) = result {
        eprintln!("error: {error}");
        return Ok(Outcome::Failed);
    }
    bench.end()?;
    print(&format!(
        "{:.0} s on the bus; the ECU's clock waited at most {} ms for this host",
        start.elapsed().as_secs_f64(),
        longest.as_millis()
    ))?;
    Ok(Outcome::Good)
}
