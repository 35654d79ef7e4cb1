//! The controller driven tick by tick: it steps when a `SimTime` frame arrives, and answers with the frames of
//! that step. The simulator compares them with its own controller's, so time here is the simulator's.
//!
//! QEMU's semihosting arguments choose the channel at start; the frames are the same on both:
//! - `slcan`: the board's CAN bus, as an outside client such as python-can would drive it;
//! - `fifo`: binary records on QEMU's standard input and output, for long runs.
//!
//! A board without QEMU has only its bus, and waits there for the next run; a panic or a fault restarts it.
//!
//! How a run starts and how an answer ends: `haptic_lockstep`.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(all(target_os = "none", feature = "semihosting"))]
mod fifo;

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("lockstep runs on a target: `cargo run --release -- ecu pil`");
}

#[cfg(target_os = "none")]
mod target {
    use cortex_m_rt::{ExceptionFrame, entry, exception};
    use embedded_can::nb::Can;
    use embedded_hal_nb::nb;
    use haptic_core::bus::Frame;
    use haptic_core::bus::messages::ResetCause;
    use haptic_core::controller::Command;
    use haptic_core::controller::config::Setup;
    use haptic_core::controller::params::Params;
    use haptic_core::ecu::{Boot, Ecu};
    use haptic_core::quantity::{Instant, Micros};
    use haptic_core::safety::faults::FaultSet;
    use haptic_core::service::rejections::Rejections;
    use haptic_core::service::stored::Stored;
    use haptic_diag::security::BENCH_KEY;
    use haptic_diag::trouble::{Cells, EMPTY};
    use haptic_firmware::boards::{Board, ThisBoard};
    use haptic_firmware::service::{Origin, Restart, Service};
    use haptic_firmware::stack;
    use haptic_firmware::storage::Found;
    use haptic_lockstep::SimTime;
    use haptic_lockstep::{Authenticated, StackUse, Start, StartState, StepCost, set_parameter};
    use haptic_secoc::Keys;
    use haptic_secoc::verifier::{Credentials, Verifier};
    use heapless::Vec;

    /// Most frames of one tick; a full bus at 500 kbit/s carries 4 a millisecond.
    const FRAMES_PER_TICK: usize = 64;

    /// Most frames that a product says beside its ECU in a step.
    const SAID: usize = 4;

    /// A client that is silent for so long is gone: the machine must not outlive it.
    const IDLE: Micros = Micros::from_ms(60_000);

    /// The stack is looked at every so many steps: looking takes longer than a step.
    const STACK_TURN: u32 = 1000;

    #[entry]
    fn main() -> ! {
        // By itself, so that a debugger finds the controller's memory.
        static mut ECU: Option<Ecu> = None;
        static mut RUN: Run = Run::NEW;
        stack::paint();
        let mut board = ThisBoard::start();
        defmt::info!("lockstep on {=str}", ThisBoard::NAME);
        #[cfg(feature = "semihosting")]
        crate::fifo::serve_if_asked(|fifo| {
            while let Ok(frame) = nb::block!(fifo.receive()) {
                RUN.take(frame, ECU, fifo);
            }
            RUN.end()
        });
        board.start_tick();
        loop {
            serve(&mut board, RUN, ECU);
            RUN.end();
        }
    }

    /// A run on the bus port, from the client's opening of the channel to its closing.
    fn serve(board: &mut ThisBoard, run: &mut Run, ecu: &mut Option<Ecu>) {
        let mut last = None;
        loop {
            match (board.can().receive(), last) {
                (Ok(frame), _) => {
                    last = Some(ThisBoard::now());
                    run.take(frame, ecu, board.can());
                }
                (Err(_), Some(_)) if board.is_hung_up() => return,
                (Err(_), Some(at)) if cfg!(feature = "semihosting") && ThisBoard::now().since(at) > IDLE => {
                    panic!("the client left the channel open and is silent")
                }
                (Err(_), _) => board.sleep(),
            }
        }
    }

    /// One run: its parameters and the frames of the tick under way.
    struct Run {
        params: Params,
        frames: Vec<Frame, FRAMES_PER_TICK>,
        steps: u32,
        rejected: u32,
        product: Option<Product>,
        /// None where no frame needs a proof.
        verifier: Option<Verifier>,
        /// Codes of faults, which a product's restart leaves alone.
        cells: Cells,
    }

    /// What a product says beside its ECU, in a run that asks for it: what it hears counts for the step, the rest for what is done
    /// behind it.
    struct Product {
        service: Service,
        /// Since it started.
        steps: u32,
        rejected: Rejections,
        /// What was asked for in this step, which begins the next start.
        restart: Option<Restart>,
        /// Class C faults of the last step, which a restart does not end.
        latched: FaultSet,
    }

    impl Product {
        /// A function of its own, so that a caller has one product on its stack and not its parts beside it.
        #[inline(never)]
        fn new(found: Found, params: &Params, boot: Boot, cells: &Cells) -> Self {
            let origin = Origin {
                boot,
                is_image_whole: true,
                key: Some(BENCH_KEY),
            };
            Self {
                service: Service::new(found, Some(*params), origin, cells),
                steps: 0,
                rejected: Rejections::NONE,
                restart: None,
                latched: FaultSet::NONE,
            }
        }

        #[inline(never)]
        fn hear(&mut self, frames: &[Frame], ecu: &mut Ecu, now: Instant) {
            for frame in frames {
                let heard = (*frame, now);
                if let Some(set) = self.service.receive(heard, ecu, &mut self.rejected, self.steps) {
                    self.restart = Some(Restart::With(set));
                }
            }
        }

        #[inline(never)]
        fn say(&mut self, command: &Command, ecu: &Ecu, cells: &mut Cells) -> Vec<Frame, SAID> {
            let mut said = Vec::new();
            // Three frames and an answer have four places.
            let _ = said.extend_from_slice(&self.service.frames(command, &mut self.rejected, self.steps));
            let asked = self
                .service
                .diagnose(cells, command, ecu, &self.rejected, self.steps);
            self.restart = self.restart.take().or(asked);
            if let Some(frame) = self.service.answer(self.steps) {
                let _ = said.push(frame);
                self.service.answered(self.steps);
            }
            self.steps = self.steps.wrapping_add(1);
            self.latched = command.faults.common(FaultSet::CRITICAL);
            said
        }
    }

    impl Run {
        const NEW: Self = Self {
            params: Params::PAPER,
            frames: Vec::new(),
            steps: 0,
            rejected: 0,
            product: None,
            verifier: None,
            cells: EMPTY,
        };

        fn take(&mut self, frame: Frame, ecu: &mut Option<Ecu>, can: &mut impl Can<Frame = Frame>) {
            if let Some(SimTime(now)) = SimTime::decode(&frame) {
                self.tick(now, ecu, can);
            } else if let Some(start) = Start::decode(&frame) {
                begin(ecu, start, &self.params);
                self.frames.clear();
                self.be_product(start.state == StartState::Product);
            } else if let Some(authenticated) = Authenticated::decode(&frame) {
                self.authenticate(authenticated);
            } else if !set_parameter(&mut self.params, &frame) && self.frames.push(frame).is_err() {
                panic!("more than {FRAMES_PER_TICK} frames in one tick");
            }
        }

        /// A function of its own, for the same reason as [`begin`].
        #[inline(never)]
        fn be_product(&mut self, is_one: bool) {
            self.product = None;
            if is_one {
                let found = Found::default();
                self.product = Some(Product::new(found, &self.params, Boot::default(), &self.cells));
            }
        }

        /// Apart for the same reason.
        #[inline(never)]
        fn authenticate(&mut self, Authenticated(algorithm): Authenticated) {
            let credentials = Credentials::Keys(Keys::bench(algorithm), Some(0));
            self.verifier = Some(Verifier::new(credentials));
        }

        /// Hands the frames of a tick to the ECU, as far as they need no proof.
        fn hear(&mut self, ecu: &mut Ecu, now: Instant) {
            for frame in &self.frames {
                let passed = match &mut self.verifier {
                    Some(verifier) => verifier.receive(frame, now),
                    None => Some((*frame, now)),
                };
                if passed.is_some_and(|(frame, at)| ecu.receive(&frame, at).is_err()) {
                    self.rejected = self.rejected.wrapping_add(1);
                }
            }
        }

        /// Hands on what is proven, and says what is to be said of it.
        fn verify(&mut self, ecu: &mut Ecu) -> Option<Frame> {
            let verifier = self.verifier.as_mut()?;
            while let Some((frame, at)) = verifier.verified() {
                if ecu.receive(&frame, at).is_err() {
                    self.rejected = self.rejected.wrapping_add(1);
                }
            }
            verifier.step(self.steps)
        }

        fn tick(&mut self, now: Instant, place: &mut Option<Ecu>, can: &mut impl Can<Frame = Frame>) {
            let boot = Start {
                state: StartState::Boot(Boot::default()),
                at: now,
            };
            if place.is_none() {
                begin(place, boot, &self.params);
            }
            let Some(ecu) = place else {
                return;
            };
            let mut heard = 0;
            if let Some(product) = &mut self.product {
                let start = ThisBoard::cycles();
                product.hear(&self.frames, ecu, now);
                heard = ThisBoard::cycles().wrapping_sub(start);
                self.frames.clear();
            }
            let start = ThisBoard::cycles();
            self.hear(ecu, now);
            let step = ecu.step(now);
            let stepped = ThisBoard::cycles();
            let background = ecu.background_step();
            let authentication = self.verify(ecu);
            let background_cycles = ThisBoard::cycles().wrapping_sub(stepped);
            let cycles = stepped.wrapping_sub(start).wrapping_add(heard);
            self.frames.clear();
            self.steps = self.steps.wrapping_add(1);
            send(can, &step.guidance);
            for frame in step.others.iter().chain(&background).chain(&authentication) {
                send(can, frame);
            }
            let start = ThisBoard::cycles();
            let product = self.product.as_mut();
            let said = product.map(|product| product.say(&step.command, ecu, &mut self.cells));
            let said_cycles = match said {
                Some(_) => ThisBoard::cycles().wrapping_sub(start),
                None => 0,
            };
            for frame in said.iter().flatten() {
                send(can, frame);
            }
            if self.steps.is_multiple_of(STACK_TURN) {
                let bytes = stack::used();
                send(can, &StackUse { bytes }.encode());
            }
            let cost = StepCost {
                cycles,
                background_cycles: background_cycles.wrapping_add(said_cycles),
            };
            send(can, &cost.encode());
            if self
                .product
                .as_ref()
                .is_some_and(|product| product.restart.is_some())
            {
                self.restart(place, now);
            }
        }

        /// A product stores a new set and starts with it, or starts anew. Here it is gone when the machine ends.
        #[inline(never)]
        fn restart(&mut self, place: &mut Option<Ecu>, now: Instant) {
            let Some(Product {
                service,
                restart: Some(restart),
                latched,
                ..
            }) = self.product.take()
            else {
                return;
            };
            let last = service.found().stored;
            let boot = Boot {
                reset: ResetCause::NewParameters,
                recent_resets: 0,
                latched,
            };
            let stored = match restart {
                Restart::With(set) => {
                    let (copy, sequence) =
                        last.map_or((0, 1), |last| (1 - last.copy, last.sequence.wrapping_add(1)));
                    self.params = set.params;
                    Some(Stored { set, sequence, copy })
                }
                Restart::AsIs => last,
            };
            let found = Found {
                stored,
                ..Found::default()
            };
            self.product = Some(Product::new(found, &self.params, boot, &self.cells));
            let start = Start {
                state: StartState::Boot(boot),
                at: now,
            };
            begin(place, start, &self.params);
        }

        /// The client has ended the run: so does QEMU.
        fn end(&self) {
            defmt::info!(
                "end of the run: {=u32} steps, {=u32} frames rejected, {=u32} of {=u32} bytes of stack used",
                self.steps,
                self.rejected,
                stack::used(),
                stack::budget()
            );
            #[cfg(feature = "semihosting")]
            haptic_firmware::host::exit(true);
        }
    }

    /// A function of its own, so that what an ECU takes to be put together is not on the stack of every step.
    #[inline(never)]
    fn begin(ecu: &mut Option<Ecu>, start: Start, params: &Params) {
        match Setup::new(params) {
            Ok(setup) => put_together(ecu, start, &setup),
            Err(error) => panic!("{error}"),
        }
    }

    /// Apart from [`begin`]: a frame that held setup and ECU at once would be larger than the guard below the stack.
    #[inline(never)]
    fn put_together(ecu: &mut Option<Ecu>, start: Start, setup: &Setup) {
        *ecu = Some(start.ecu_with(setup));
    }

    fn send(can: &mut impl Can<Frame = Frame>, frame: &Frame) {
        if nb::block!(can.transmit(frame)).is_err() {
            panic!("an answer could not be sent");
        }
    }

    fn give_up() -> ! {
        ThisBoard::zero_torque();
        #[cfg(feature = "semihosting")]
        haptic_firmware::host::exit(false);
        #[cfg(not(feature = "semihosting"))]
        cortex_m::peripheral::SCB::sys_reset()
    }

    #[panic_handler]
    fn panic(info: &core::panic::PanicInfo) -> ! {
        ThisBoard::zero_torque();
        defmt::error!("panic: {}", defmt::Display2Format(info));
        give_up()
    }

    #[exception]
    unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
        ThisBoard::zero_torque();
        defmt::error!("fault at {=u32:#010x}", frame.pc());
        give_up()
    }
}
