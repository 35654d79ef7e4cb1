//! What a customer would check, across the crates; one program, a module a subject. `cargo test -p haptic-guidance pil::` runs
//! one of them.

mod authentication;
mod availability;
mod closed_loop;
mod design;
mod faults;
mod faults_in_qemu;
mod handover;
mod identify_bar;
mod identify_bus_trace;
mod identify_causes;
mod identify_changes;
mod identify_degenerate;
mod identify_foreign_logs;
mod identify_layouts;
mod identify_participants;
mod identify_spoiled;
mod layering;
mod machine;
mod paper_claims;
mod parameters;
mod parts;
mod pil;
mod product_image;
mod reliance;
mod resets;
mod startup;
mod track_changing_driver;
mod unclipped;
mod wording;

use haptic_sim::scenario::GuidanceParameters;

/// The default guidance with a probe of 0.2 N.m.
fn probing() -> GuidanceParameters {
    let mut guidance = GuidanceParameters {
        probe: true,
        ..Default::default()
    };
    guidance.controller.probe_amplitude_nm = 0.2;
    guidance
}
