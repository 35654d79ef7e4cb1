//! A file of keys of `cargo xtask keys`, for tools that speak as an ECU's host or tester.

use std::path::Path;

use haptic_pil::diagnosis::{KEY_BYTES, Key};
use haptic_secoc::Keys;
use haptic_secoc::fresh::Algorithm;
use haptic_sim::input::InputError;

/// The keys of camera and host, and that of security access.
pub(super) fn load(path: &Path) -> Result<(Keys, Key), InputError> {
    let wrong = |what: String| InputError::new(path.display().to_string(), what);
    let text = std::fs::read_to_string(path).map_err(|e| wrong(e.to_string()))?;
    // What the parser says would quote a key.
    let file: toml::Table = text
        .parse()
        .map_err(|_| wrong("not TOML: mac, camera, host and access are wanted".into()))?;
    let field = |name: &str| match file.get(name) {
        Some(toml::Value::String(text)) => Ok(text),
        _ => Err(wrong(format!("{name} is missing, or no text in quotation marks"))),
    };
    let key = |name: &str| -> Result<Key, InputError> {
        let refused = || wrong(format!("{name}: a key has 16 bytes, 32 hexadecimal digits"));
        from_digits(field(name)?).ok_or_else(refused)
    };
    let keys = Keys {
        algorithm: match field("mac")?.as_str() {
            "siphash" => Algorithm::SipHash,
            "aes-cmac" => Algorithm::AesCmac,
            _ => return Err(wrong("mac: siphash or aes-cmac is wanted".into())),
        },
        camera: key("camera")?,
        host: key("host")?,
    };
    Ok((keys, key("access")?))
}

/// A key of its hexadecimal digits.
pub(super) fn from_digits(digits: &str) -> Option<Key> {
    let is_key = digits.len() == 2 * KEY_BYTES && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    let number = u128::from_str_radix(digits, 16).ok().filter(|_| is_key);
    number.map(u128::to_be_bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The errors name the field, and never quote a key.
    #[test]
    fn a_file_of_keys_is_read_or_says_what_is_wrong() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("keys.toml");
        let bench = Keys::bench(Algorithm::AesCmac);
        let text = |key: &[u8]| key.iter().map(|byte| format!("{byte:02x}")).collect::<String>();
        let [camera, host] = [text(&bench.camera), text(&bench.host)];
        let whole =
            format!("mac = \"aes-cmac\"\ncamera = \"{camera}\"\nhost = \"{host}\"\naccess = \"{host}\"\n");
        std::fs::write(&file, &whole).unwrap();
        let (keys, access) = load(&file).unwrap();
        assert!(keys == bench && access == bench.host);
        for (spoiled, says) in [
            (whole.replace("host", "hots"), "host is missing"),
            (whole.replace("aes-cmac", "md5"), "siphash or aes-cmac"),
            (whole.replace(&camera[..1], "+"), "32 hexadecimal digits"),
            (whole.replace("access = ", "access "), "not TOML"),
        ] {
            std::fs::write(&file, &spoiled).unwrap();
            let Err(refused) = load(&file) else {
                panic!("{says}")
            };
            let refused = refused.to_string();
            assert!(
                refused.contains(says) && !refused.contains(&host[..8]),
                "{refused}"
            );
        }
    }
}
