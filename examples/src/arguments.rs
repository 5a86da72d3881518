//! Parsers of command-line values (counts, bytes, shares, picture sizes), and arguments to pass on to another
//! program.

use crate::{Hint, Reading};
use clap::builder::RangedU64ValueParser;
use std::fmt::Display;
use std::path::Path;
use std::str::FromStr;

/// Maximum number of frames, movers, viewcells or the like that a user may ask for. Each takes some hundred
/// bytes, so a greater number is most likely a mistake.
const MAX_COUNT: u64 = 1_000_000;

/// Returns a parser of a count from 1 to 1,000,000.
pub fn count() -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(1..=MAX_COUNT)
}

/// Reads a width and a height in pixels from text such as `640x360`. Returns a message as the error if the
/// `x` is missing, or a side is not a number or is 0.
pub fn parse_size<T: FromStr<Err: Display> + From<u8> + PartialEq>(text: &str) -> Result<[T; 2], String> {
    let (width, height) = text.split_once('x').ok_or("a size looks like 640x360")?;
    let side = |text: &str| match text.parse() {
        Ok(side) if side == T::from(0) => Err("a side has at least 1 pixel".to_owned()),
        Ok(side) => Ok(side),
        Err(error) => Err(format!("{text}: {error}")),
    };
    Ok([side(width)?, side(height)?])
}

/// Reads a number of bytes from text, such as 512M or 2G.
pub fn parse_bytes(text: &str) -> Result<u64, String> {
    let (number, unit) = match text.char_indices().next_back() {
        Some((end, 'k' | 'K')) => (&text[..end], 10),
        Some((end, 'm' | 'M')) => (&text[..end], 20),
        Some((end, 'g' | 'G')) => (&text[..end], 30),
        _ => (text, 0),
    };
    let number: Option<u64> = number.parse().ok();
    let bytes = number.and_then(|number| number.checked_mul(1 << unit));
    bytes.ok_or_else(|| "a size is a number of bytes, or as in 512M or 2G".to_owned())
}

/// Reads a share from text: a number from 0 to 1, or a percentage up to 100%.
pub fn parse_share(text: &str) -> Result<f64, String> {
    let (number, unit) = text.strip_suffix('%').map_or((text, 1.0), |number| (number, 0.01));
    match number.trim().parse::<f64>() {
        Ok(number) if (0.0..=1.0).contains(&(number * unit)) => Ok(number * unit),
        _ => Err("a part is a number from 0 to 1, or a percentage up to 100%".to_owned()),
    }
}

/// Quotes a word of a command for a Unix shell, if it has characters with a meaning to the shell.
pub fn quoted(word: &str) -> String {
    let is_plain = |letter: char| letter.is_alphanumeric() || "-_.,:+=/".contains(letter);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

/// Returns the arguments that make another program read a scene in the same way, quoted for a Unix shell:
/// name, unit, up axis, sides, cameras, and hints for objects.
pub fn scene_arguments(
    scene: &str,
    reading: &Reading,
    cameras: Option<&Path>,
    hints: &[(Hint, String)],
) -> String {
    let mut arguments = quoted(scene) + &reading.arguments();
    if let Some(cameras) = cameras {
        arguments += &format!(" --cameras {}", quoted(&cameras.display().to_string()));
    }
    for (hint, part) in hints {
        arguments += &format!(" --hint {}", quoted(&format!("{hint}={part}")));
    }
    arguments
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_two_positive_numbers() {
        assert_eq!(parse_size::<u32>("640x360"), Ok([640, 360]), "a size in pixels");
        for (text, why) in [
            ("0x0", "at least 1 pixel"),
            ("4x0", "at least 1 pixel"),
            ("640", "looks like"),
            ("-4x4", "-4: "),
            ("4294967296x4", "4294967296: "),
        ] {
            let error = parse_size::<u32>(text).unwrap_err();
            assert!(error.contains(why), "{text} is refused with `{error}`, expected `{why}`");
        }
    }

    #[test]
    fn numbers_of_bytes_are_read_or_refused() {
        assert_eq!(
            (parse_bytes("512M"), parse_bytes("2g"), parse_bytes("77")),
            (Ok(512 << 20), Ok(2 << 30), Ok(77)),
            "sizes in mebibytes, gibibytes and bytes"
        );
        for wrong in ["", "M", "1.5G", "-1", "99999999999G", "1T"] {
            assert!(parse_bytes(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn parts_are_read_or_refused() {
        assert_eq!(
            (parse_share("5%"), parse_share("0.05"), parse_share("1")),
            (Ok(0.05), Ok(0.05), Ok(1.0)),
            "parts in percent and as numbers"
        );
        for wrong in ["", "5", "-1%", "101%", "nan", "x"] {
            assert!(parse_share(wrong).is_err(), "{wrong}");
        }
    }
}
