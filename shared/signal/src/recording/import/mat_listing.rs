//! Names and kinds of the variables in a MATLAB file of version 5, which `matfile` passes over where
//! they are no numbers.
//!
//! Source: The `MathWorks`, *MAT-File Format*, R2020b, chapter 1.

use flate2::read::ZlibDecoder;
use std::io::Read;

const HEADER_BYTES: usize = 128;
const TAG_BYTES: usize = 8;
/// Types of elements at the top.
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
/// Bytes of a variable that hold its flags, sizes and name.
const BEGIN_BYTES: u64 = 4096;

/// A variable of the file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Variable {
    /// Its name.
    pub name: String,
    /// The number of its class.
    class: u32,
    is_complex: bool,
    is_logical: bool,
}

impl Variable {
    /// What it is, unless it is an array of real numbers.
    pub(super) fn kind(&self) -> Option<String> {
        let kind = match self.class {
            1 => "a cell array",
            2 => "a structure: save its fields as separate variables (`save -struct`)",
            4 => "text",
            5 => "a sparse array",
            6..=15 if self.is_complex => "complex numbers: save the real part or the magnitude",
            6..=15 if self.is_logical => "Boolean values",
            6..=15 => return None,
            16 => "a function",
            _ => "an object such as a table, a string or a time",
        };
        Some(kind.to_owned())
    }

    /// Whether it is an object of a class.
    pub(super) const fn is_opaque(&self) -> bool {
        !matches!(self.class, 1..=15)
    }
}

/// All variables; of a file that is cut off, those before the cut.
pub(super) fn list(bytes: &[u8]) -> Vec<Variable> {
    let is_little = bytes.get(126..128) == Some(b"IM");
    let mut rest = bytes.get(HEADER_BYTES..).unwrap_or_default();
    let mut all = Vec::new();
    while let Some((kind, size)) = tag(rest, is_little) {
        let Some(content) = rest.get(TAG_BYTES..) else { break };
        let inner = content.get(..size).unwrap_or(content);
        let variable = match kind {
            MATRIX => variable(inner, is_little),
            COMPRESSED => {
                let mut begin = Vec::new();
                // The end of what is read may be cut off: only the beginning matters.
                let _ = ZlibDecoder::new(inner).take(BEGIN_BYTES).read_to_end(&mut begin);
                begin.get(TAG_BYTES..).and_then(|inner| variable(inner, is_little))
            }
            _ => None,
        };
        all.extend(variable);
        rest = content.get(size..).unwrap_or_default();
    }
    all
}

/// Type and size of an element.
fn tag(bytes: &[u8], is_little: bool) -> Option<(u32, usize)> {
    Some((word(bytes, 0, is_little)?, word(bytes, 4, is_little)? as usize))
}

fn word(bytes: &[u8], at: usize, is_little: bool) -> Option<u32> {
    let four = bytes.get(at..at + 4)?.try_into().ok()?;
    Some(if is_little { u32::from_le_bytes(four) } else { u32::from_be_bytes(four) })
}

/// Flags, sizes and name at the beginning of a matrix.
fn variable(bytes: &[u8], is_little: bool) -> Option<Variable> {
    let flags = word(bytes, TAG_BYTES, is_little)?;
    let class = flags & 0xff;
    let mut rest = bytes.get(2 * TAG_BYTES..)?;
    // Objects of classes have no sizes.
    if class != 17 {
        let (_, size) = tag(rest, is_little)?;
        rest = rest.get(TAG_BYTES + size.next_multiple_of(TAG_BYTES)..)?;
    }
    let name = String::from_utf8_lossy(short(rest, is_little)?).into_owned();
    let (is_complex, is_logical) = (flags & 0x0800 != 0, flags & 0x0200 != 0);
    // What an object keeps beside the variables has no name.
    (!name.is_empty()).then_some(Variable { name, class, is_complex, is_logical })
}

/// The bytes of an element, which lie in its tag if there are four at most.
fn short(bytes: &[u8], is_little: bool) -> Option<&[u8]> {
    let first = word(bytes, 0, is_little)?;
    let packed = (first >> 16) as usize;
    if packed > 0 {
        return bytes.get(4..4 + packed.min(4));
    }
    let (_, size) = tag(bytes, is_little)?;
    bytes.get(TAG_BYTES..TAG_BYTES + size)
}
