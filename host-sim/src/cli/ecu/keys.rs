//! A file of keys of `cargo xtask keys`, for tools that speak as an ECU's host or tester.

use std::path::Path;

use haptic_pil::diagnosis::Key;
use haptic_secoc::Keys;
use haptic_secoc::fresh::Algorithm;
use haptic_sim::input::InputError;
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    mac: Mac,
    camera: String,
    host: String,
    access: String,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Mac {
    Siphash,
    AesCmac,
}

/// The keys of camera and host, and that of security access.
pub(super) fn load(path: &Path) -> Result<(Keys, Key), InputError> {
    let wrong = |what: String| InputError::new(path.display().to_string(), what);
    let text = std::fs::read_to_string(path).map_err(|e| wrong(e.to_string()))?;
    // What the parser says would quote a key.
    let file: File = toml::from_str(&text).map_err(|_| {
        let what = "not a file of keys: mac (siphash or aes-cmac), camera, host and access, and nothing else";
        wrong(what.into())
    })?;
    let key = |name: &str, text: &str| {
        let number = u128::from_str_radix(text, 16).ok().filter(|_| text.len() == 32);
        let number =
            number.ok_or_else(|| wrong(format!("{name}: a key has 16 bytes, 32 hexadecimal digits")))?;
        Ok::<_, InputError>(number.to_be_bytes())
    };
    let keys = Keys {
        algorithm: match file.mac {
            Mac::Siphash => Algorithm::SipHash,
            Mac::AesCmac => Algorithm::AesCmac,
        },
        camera: key("camera", &file.camera)?,
        host: key("host", &file.host)?,
    };
    Ok((keys, key("access", &file.access)?))
}
