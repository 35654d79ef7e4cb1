//! The product (`product`): nothing but its loop.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("steering-ecu runs on a target: `cargo xtask qemu steering-ecu`");
}

#[cfg(target_os = "none")]
mod target {
    use cortex_m_rt::entry;
    use haptic_core::ecu::Ecu;
    use haptic_firmware::product;
    use haptic_firmware::service::Service;
    use haptic_secoc::verifier::Verifier;

    #[entry]
    fn main() -> ! {
        // A static and not on the stack, so that its size shows in the image's RAM.
        static mut ECU: Option<Ecu> = None;
        static mut SERVICE: Option<Service> = None;
        static mut VERIFIER: Option<Verifier> = None;
        product::run(ECU, SERVICE, VERIFIER, |_, _, _| {})
    }

    haptic_firmware::stop_on_panic_and_fault!();
}
