//! The machine code of an image: its functions, what they call, the stack they take, and whether they compute in
//! floating point. Read from llvm-objdump, of the very image that goes onto a board.
//!
//! [`Code::torque_path`] follows the calls from the functions where the torque path begins ([`CONTROLLER`],
//! [`PRODUCT`]). What it cannot follow, a call through a pointer or a recursion, is an error: nothing there can hide.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};

use crate::tool;

/// Where the controller's torque path begins.
pub(crate) const CONTROLLER: [&str; 2] = [
    "haptic_core::ecu::Ecu::receive::",
    "haptic_core::ecu::Ecu::step::",
];
/// Where the product's begins: the same with the board's sensors, its motor stage, its clock and its watchdog.
pub(crate) const PRODUCT: [&str; 2] = [CONTROLLER[0], "haptic_firmware::product::control::"];

/// A function.
#[derive(Debug, Default)]
struct Function {
    name: String,
    /// Bytes that it takes from the stack.
    frame: u64,
    /// The largest piece that it takes at once: what could step over the guard.
    step: u64,
    /// Addresses of the functions that it calls or jumps to.
    calls: BTreeSet<u64>,
    /// A call through a register.
    by_pointer: Option<String>,
    /// A floating-point operation.
    float: Option<String>,
}

/// The functions of an image, by address.
pub(crate) struct Code(BTreeMap<u64, Function>);

/// What is reachable from the torque path.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TorquePath {
    pub(crate) functions: usize,
    /// The most stack that any way through it takes.
    pub(crate) stack: u64,
}

impl Code {
    pub(crate) fn from_image(elf: &Path) -> Result<Self> {
        let text = tool::output(
            tool::llvm("llvm-objdump")?
                .args(["-d", "-C", "--no-show-raw-insn"])
                .arg(elf),
        )?;
        let code = Self::read(&text);
        ensure!(code.0.len() > 20, "{}: hardly a function", elf.display());
        Ok(code)
    }

    fn read(text: &str) -> Self {
        let mut functions = BTreeMap::new();
        let mut here = None;
        for line in text.lines() {
            if let Some((address, name)) = head(line) {
                here = Some(address);
                let name = name.to_owned();
                functions.insert(
                    address,
                    Function {
                        name,
                        ..Function::default()
                    },
                );
            } else if let Some((address, (mnemonic, operands))) = here.zip(instruction(line))
                && let Some(function) = functions.get_mut(&address)
            {
                function.take(address, mnemonic, operands);
            }
        }
        Self(functions)
    }

    /// The largest piece of stack that any function takes at once, bytes.
    pub(crate) fn largest_frame(&self) -> u64 {
        self.0.values().map(|function| function.step).max().unwrap_or(0)
    }

    /// Follows the torque path from functions whose names begin so.
    ///
    /// # Errors
    /// A panic or a floating-point operation on it, or what cannot be followed.
    pub(crate) fn torque_path(&self, roots: [&str; 2]) -> Result<TorquePath> {
        let mut depths = BTreeMap::new();
        let mut deepest = 0;
        for root in roots {
            let (address, _) = self
                .0
                .iter()
                .find(|(_, function)| function.name.starts_with(root))
                .with_context(|| format!("{root} is not in the image: is it inlined?"))?;
            deepest = deepest.max(self.depth(*address, &mut Vec::new(), &mut depths)?);
        }
        Ok(TorquePath {
            functions: depths.len(),
            stack: deepest,
        })
    }

    /// The most stack that calls from a function down take. Calls through pointers, which the log and text formatting
    /// make, are not followed.
    pub(crate) fn stack_of(&self, name: &str) -> Result<u64> {
        let root = self.0.iter().find(|(_, function)| function.name == name);
        let (address, _) = root.with_context(|| format!("{name} is not in the image"))?;
        Ok(self.calls_below(*address, &mut Vec::new(), &mut BTreeMap::new()))
    }

    fn calls_below(&self, address: u64, way: &mut Vec<u64>, depths: &mut BTreeMap<u64, u64>) -> u64 {
        if let Some(depth) = depths.get(&address) {
            return *depth;
        }
        let Some(function) = self.0.get(&address).filter(|_| !way.contains(&address)) else {
            return 0;
        };
        way.push(address);
        let below = function
            .calls
            .iter()
            .map(|call| self.calls_below(*call, way, depths));
        let depth = function.frame + below.max().unwrap_or(0);
        way.pop();
        depths.insert(address, depth);
        depth
    }

    fn depth(&self, address: u64, way: &mut Vec<u64>, depths: &mut BTreeMap<u64, u64>) -> Result<u64> {
        if let Some(depth) = depths.get(&address) {
            return Ok(*depth);
        }
        let function = self
            .0
            .get(&address)
            .with_context(|| format!("a call of {address:#x}, where no function begins"))?;
        let name = &function.name;
        let via = || {
            let names = way.iter().filter_map(|address| self.0.get(address));
            names
                .map(|function| function.name.as_str())
                .collect::<Vec<_>>()
                .join(" > ")
        };
        if way.contains(&address) {
            bail!("recursion: {} > {name}", via());
        }
        if name.contains("panic") || name.contains("unwrap_failed") || is_soft_float(name) {
            bail!("reachable from the controller's step: {} > {name}", via());
        }
        if let Some(what) = &function.float {
            bail!(
                "floating point in the controller's step: {} > {name}: {what}",
                via()
            );
        }
        if let Some(what) = &function.by_pointer {
            bail!("a call that cannot be followed: {} > {name}: {what}", via());
        }
        way.push(address);
        let mut below = 0;
        for call in &function.calls {
            below = below.max(self.depth(*call, way, depths)?);
        }
        way.pop();
        let depth = function.frame + below;
        depths.insert(address, depth);
        Ok(depth)
    }
}

impl Function {
    fn take(&mut self, own: u64, mnemonic: &str, operands: &str) {
        let taken = stack(mnemonic, operands);
        self.frame += taken;
        self.step = self.step.max(taken);
        let base = mnemonic.split('.').next().unwrap_or(mnemonic);
        let is_jump = base.starts_with('b')
            && !["bic", "bfi", "bfc", "bkpt"]
                .iter()
                .any(|other| base.starts_with(other))
            || base.starts_with("cb");
        if is_jump {
            match target(operands) {
                Some(address) if address != own => drop(self.calls.insert(address)),
                Some(_) => {}
                None if operands.trim() == "lr" || operands.contains('<') => {}
                None => self.by_pointer = Some(format!("{mnemonic} {operands}")),
            }
        }
        if is_float(base) {
            self.float = Some(format!("{mnemonic} {operands}"));
        }
    }
}

/// `08003aa0 <name>:`
pub(crate) fn head(line: &str) -> Option<(u64, &str)> {
    let (address, name) = line.split_once(" <")?;
    let address = u64::from_str_radix(address, 16).ok()?;
    Some((address, name.strip_suffix(">:")?))
}

/// ` 8003aa0:      \tpush\t{r4, lr}` as mnemonic and operands, without a comment.
pub(crate) fn instruction(line: &str) -> Option<(&str, &str)> {
    let (_, rest) = line.split_once(":")?;
    let rest = rest.trim_start_matches(' ').strip_prefix('\t')?;
    let (mnemonic, operands) = rest.split_once('\t').unwrap_or((rest, ""));
    let operands = operands.split(" @ ").next().unwrap_or(operands);
    Some((mnemonic.trim(), operands.trim()))
}

/// The place that `0x800133c <name+0x4>` names; None for a register.
pub(crate) fn any_target(operands: &str) -> Option<u64> {
    let (before, _) = operands.split_once(" <")?;
    let (_, address) = before.rsplit_once("0x")?;
    u64::from_str_radix(address, 16).ok()
}

/// The function that `0x800133c <name>` names; None for a place within one, or a register.
fn target(operands: &str) -> Option<u64> {
    let (_, name) = operands.split_once(" <")?;
    // Names of generics hold a `+` too, but never one before a hexadecimal number at the end.
    let is_within = name
        .trim_end_matches('>')
        .rsplit_once('+')
        .is_some_and(|(_, offset)| offset.starts_with("0x"));
    if is_within { None } else { any_target(operands) }
}

/// Bytes that an instruction takes from the stack: `sub.w sp, sp, #0x200`, `push {r4, lr}`, `vpush {d8, d9}`.
fn stack(mnemonic: &str, operands: &str) -> u64 {
    let registers = || operands.split(',').count() as u64;
    match mnemonic.split('.').next() {
        Some("push") => 4 * registers(),
        Some("stmdb") if operands.starts_with("sp!") => 4 * (registers() - 1),
        Some("vpush") => 8 * registers(),
        Some("str") if operands.contains("[sp, #-") && operands.ends_with('!') => 4,
        Some("sub" | "subw") => {
            let amount = operands.strip_prefix("sp, ");
            let amount = amount.map(|amount| amount.strip_prefix("sp, ").unwrap_or(amount));
            amount
                .and_then(|amount| number(amount.strip_prefix('#')?))
                .unwrap_or(0)
        }
        _ => 0,
    }
}

fn number(text: &str) -> Option<u64> {
    match text.strip_prefix("0x") {
        Some(hex) => u64::from_str_radix(hex, 16).ok(),
        None => text.parse().ok(),
    }
}

/// Whether the floating-point unit computes: it also moves words about, which is no floating point.
fn is_float(mnemonic: &str) -> bool {
    let moves = [
        "vldr", "vstr", "vmov", "vpush", "vpop", "vldm", "vstm", "vmrs", "vmsr", "vldmia", "vstmia",
        "vldmdb", "vstmdb",
    ];
    mnemonic.starts_with('v') && !moves.contains(&mnemonic)
}

/// Names of the run-time ABI for ARM (`__aeabi_dadd`, `__aeabi_i2f`) and of compiler-rt (`__adddf3`,
/// `__fixdfsi`).
pub(crate) fn is_soft_float(symbol: &str) -> bool {
    let is_aeabi = symbol.strip_prefix("__aeabi_").is_some_and(|name| {
        let converts_to = ["i2f", "i2d", "ui2f", "ui2d", "l2f", "l2d", "ul2f", "ul2d"];
        name.starts_with(['f', 'd'])
            || name.starts_with("cf")
            || name.starts_with("cd")
            || converts_to.contains(&name)
    });
    let is_compiler_rt = symbol.starts_with("__")
        && [
            "sf2", "df2", "sf3", "df3", "sfsi", "dfsi", "sfdi", "dfdi", "sisf", "sidf", "disf", "didf",
        ]
        .iter()
        .any(|end| symbol.ends_with(end));
    is_aeabi || is_compiler_rt
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What llvm-objdump prints of a step that calls two functions, one of which jumps on.
    const TEXT: &str = "
08000100 <haptic_core::ecu::Ecu::receive::h01>:
 8000100:      \tbx\tlr

08000200 <haptic_core::ecu::Ecu::step::h02>:
 8000200:      \tpush.w\t{r4, r5, lr}
 8000204:      \tvpush\t{d8, d9}
 8000206:      \tsub.w\tsp, sp, #0x200
 800020a:      \tbl\t0x8000300 <<core::ops::A as B>::first> @ imm = #0xf0
 800020e:      \tbeq\t0x8000206 <haptic_core::ecu::Ecu::step::h02+0x6> @ imm = #-0xc
 8000212:      \tcbz\tr0, 0x800020e <haptic_core::ecu::Ecu::step::h02+0xe> @ imm = #-0x8
 8000214:      \tpop\t{r4, r5, pc}

08000300 <<core::ops::A as B>::first>:
 8000300:      \tsub\tsp, #0x8
 8000302:      \tvldr\td0, [sp]
 8000304:      \tb.w\t0x8000400 <second> @ imm = #0xfc

08000400 <second>:
 8000400:      \tpush\t{r7, lr}
 8000402:      \tsubs\tr0, r1, #0x8
 8000404:      \tpop\t{r7, pc}
";

    fn path(text: &str) -> Result<TorquePath> {
        Code::read(text).torque_path(CONTROLLER)
    }

    #[test]
    fn calls_are_followed_and_the_stack_is_summed() {
        let found = path(TEXT).unwrap();
        // 3 words, two doubles, 512; then 8; then 2 words.
        assert_eq!(found.stack, 12 + 16 + 512 + 8 + 8);
        assert_eq!(found.functions, 4);
        assert_eq!(Code::read(TEXT).largest_frame(), 512);
        // A pointer and a recursion stop the walk only.
        let other = TEXT
            .replace("subs\tr0, r1, #0x8", "blx\tr3")
            .replace("pop\t{r7, pc}", "b.w\t0x8000300 <x>");
        let first = "<core::ops::A as B>::first";
        assert_eq!(Code::read(&other).stack_of(first).unwrap(), 8 + 8);
    }

    #[test]
    fn a_panic_a_float_a_pointer_and_a_recursion_are_found() {
        let says = |from: &str, to: &str| path(&TEXT.replace(from, to)).unwrap_err().to_string();
        assert!(says("<second>", "<core::panicking::panic_fmt>").contains("first > core::panicking"));
        assert!(says("<second>", "<__aeabi_dadd>").contains("__aeabi_dadd"));
        assert!(says("subs\tr0, r1, #0x8", "vadd.f32\ts0, s0, s1").contains("vadd.f32"));
        assert!(says("subs\tr0, r1, #0x8", "blx\tr3").contains("blx r3"));
        assert!(says("subs\tr0, r1, #0x8", "bl\t0x8000300 <x>").contains("recursion"));
        assert!(says("ecu::Ecu::step", "ecu::Ecu::inlined").contains("is it inlined?"));
        // A bit clear on a condition is no branch.
        assert!(path(&TEXT.replace("subs\tr0, r1, #0x8", "bicne.w\tr0, r0, r4, lsl #3")).is_ok());
    }

    /// Names as the ABI's document (IHI 0043) lists them.
    #[test]
    fn float_calls_are_told_from_integer_calls() {
        for name in [
            "__aeabi_dadd",
            "__aeabi_fmul",
            "__aeabi_d2iz",
            "__aeabi_ul2d",
            "__aeabi_cfcmple",
            "__adddf3",
        ] {
            assert!(is_soft_float(name), "{name}");
        }
        for name in [
            "__aeabi_ldivmod",
            "__aeabi_uidiv",
            "__aeabi_memcpy4",
            "__aeabi_lmul",
            "__divmoddi4",
        ] {
            assert!(!is_soft_float(name), "{name}");
        }
    }
}
