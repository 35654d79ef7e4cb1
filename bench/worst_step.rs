//! Instructions of the ECU's worst step in each row of the fault campaign, counted in QEMU. The target gets what the ECU of the closed
//! loop got. Prints one JSON object, the worst row first: `worst` of the steps whose frames a bus can carry, `with_any_frames` of all, as
//! some rows hand over more. `left_out` are the rows that change the ECU itself, whose answers the target does not repeat; those
//! that run on a target alone are not there.
//!
//!     cargo run --release --example worst_step -p haptic-campaign -- [SEEDS]

use haptic_campaign::table::{Place, rows};
use haptic_campaign::{World, target};
use haptic_pil::PilError;
use haptic_pil::stepped::Stepped;

fn main() -> Result<(), PilError> {
    let seeds = std::env::args().nth(1).map_or(Ok(1), |seeds| seeds.parse());
    let Ok(seeds @ 1..) = seeds else {
        eprintln!("usage: worst_step [SEEDS], runs of each row, 1 or more");
        std::process::exit(2);
    };
    let world = World::new(None);
    let mut ecu = Stepped::counting()?;
    let (mut counted, mut left_out) = (Vec::new(), Vec::new());
    for row in rows().filter(|row| row.place != Place::Target && row.left_out(world.has_bar()).is_none()) {
        let worst = (1..=seeds).map(|seed| target::worst_steps(&mut ecu, &world, row, seed));
        match worst.collect::<Result<Option<Vec<_>>, _>>()? {
            Some(worst) => {
                let most = |which: usize| worst.iter().map(|steps| steps[which]).max();
                counted.push((most(1), most(0), row.name));
            }
            None => left_out.push(row.name),
        }
    }
    ecu.end()?;
    counted.sort_unstable_by(|a, b| b.cmp(a));
    let rows: Vec<_> = (counted.iter())
        .map(|(carried, any, row)| serde_json::json!({"row": row, "worst": carried, "with_any_frames": any}))
        .collect();
    println!(
        "{}",
        serde_json::json!({"seeds": seeds, "rows": rows, "left_out": left_out})
    );
    Ok(())
}
