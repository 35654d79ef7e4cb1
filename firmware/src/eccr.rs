//! Where the STM32G4's flash controller puts an error that its code of correction does not mend (register ECCR of
//! RM0440), and whether that is among codes, starts, keys and parameters. Apart from the board's file so that it is tested on a desktop.

/// Bytes of a bank, of a page, and the pages that hold codes, starts, keys and parameters: the last of the second bank.
const BANK: u32 = 256 * 1024;
const PAGE: u32 = 2 * 1024;
const PARAMETER_PAGES: u32 = 9;

/// BK_ECC (the second bank), SYSF_ECC (the system's own flash) and ADDR_ECC (bytes from the bank's start).
pub type Place = (bool, bool, u32);

/// Whether the word is one of codes, starts, keys or parameters, whose reader has a CRC to tell by.
pub const fn is_in_parameters((is_second, is_system, address): Place) -> bool {
    is_second && !is_system && address < BANK && address >= BANK - PARAMETER_PAGES * PAGE
}

#[cfg(test)]
mod tests {
    use super::is_in_parameters;

    /// 0x0807_B800 to 0x0807_FFFF, which `nucleo_g474re.x` leaves out of FLASH: 494 KiB from 0x0800_0000.
    #[test]
    fn the_parameters_end_where_the_image_may_not_reach() {
        let map = include_str!("boards/nucleo_g474re.x");
        assert!(map.contains("ORIGIN = 0x08000000, LENGTH = 494K"));
        let offset = |address: u32| address - 0x0804_0000;
        for (address, expected) in [
            (0x0807_B7F8, false),
            (0x0807_B800, true),
            (0x0807_FFF8, true),
            (0x0808_0000, false),
        ] {
            assert_eq!(
                is_in_parameters((true, false, offset(address))),
                expected,
                "{address:#x}"
            );
            assert!(
                !is_in_parameters((false, false, offset(address))),
                "the first bank"
            );
            assert!(
                !is_in_parameters((true, true, offset(address))),
                "the system's flash"
            );
        }
        assert!(!is_in_parameters((true, false, 0)) && !is_in_parameters((false, false, 0)));
    }
}
