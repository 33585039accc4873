//! Bytes of text files as text, in whichever encoding they were written.

use super::super::error::Fault;

/// Number of bytes examined to detect UTF-16 without a byte-order mark.
const LOOKED_AT: usize = 1000;

/// UTF-8, UTF-16 of either order with or without a mark, else Latin-1.
///
/// # Errors
/// [`Fault::NoText`] names the first byte that no text has.
pub(super) fn decode(bytes: &[u8]) -> Result<String, Fault> {
    if let Some(text) = utf_16(bytes) {
        return Ok(text);
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let is_control = |byte: &u8| matches!(byte, 0..=8 | 14..=26 | 28..=31);
    if let Some(index) = bytes.iter().position(is_control) {
        // A file of DOS may end with this one.
        let rest = &bytes[index..];
        if rest.iter().any(|byte| *byte != 0x1a) {
            return Err(Fault::NoText { byte: index + 1, value: bytes[index] });
        }
        return decode(&bytes[..index]);
    }
    Ok(match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().map(|&byte| char::from(byte)).collect(),
    })
}

/// Makes a unit of UTF-16 from two bytes.
type Unit = fn([u8; 2]) -> u16;

/// The text if the bytes are UTF-16: every second byte is zero, or there is a byte-order mark.
fn utf_16(bytes: &[u8]) -> Option<String> {
    let looked_at = &bytes[..bytes.len().min(LOOKED_AT)];
    let noughts = |odd: usize| {
        let every_other = looked_at.iter().skip(odd).step_by(2);
        2 * every_other.filter(|byte| **byte == 0).count() > looked_at.len() / 2
    };
    let (bytes, unit): (&[u8], Unit) = match bytes {
        [0xff, 0xfe, rest @ ..] => (rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => (rest, u16::from_be_bytes),
        _ if noughts(1) && !noughts(0) => (bytes, u16::from_le_bytes),
        _ if noughts(0) && !noughts(1) => (bytes, u16::from_be_bytes),
        _ => return None,
    };
    let (pairs, _) = bytes.as_chunks::<2>();
    char::decode_utf16(pairs.iter().map(|pair| unit(*pair))).collect::<Result<_, _>>().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_encoding_gives_the_same_text() {
        let text = "t;a (m/s\u{b2})\n0;1,5\n1;-2\n";
        let le: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        let be: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
        let latin: Vec<u8> = text.chars().map(|c| c as u8).collect();
        let marked = |mark: &[u8], bytes: &[u8]| [mark, bytes].concat();
        for bytes in [
            text.as_bytes().to_vec(),
            marked(b"\xef\xbb\xbf", text.as_bytes()),
            marked(b"\xff\xfe", &le),
            marked(b"\xfe\xff", &be),
            le,
            be,
            marked(&latin, b"\x1a"),
            latin,
        ] {
            assert_eq!(decode(&bytes).unwrap(), text, "{bytes:?}");
        }
    }

    #[test]
    fn bytes_that_are_no_text_are_named() {
        let fault = decode(b"t,acc\n1,\x00\x02").unwrap_err();
        assert!(matches!(fault, Fault::NoText { byte: 9, value: 0 }), "{fault:?}");
    }
}
