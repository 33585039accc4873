//! Compiles the farm's messages, without `protoc`.

use prost_types::FileDescriptorSet;
use prost_types::field_descriptor_proto::{Label, Type};
use std::error::Error;

/// Path of the message definitions, relative to this crate.
const PROTO_ROOT: &str = "../../proto";

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed={PROTO_ROOT}");
    let mut descriptors = protox::compile(["farm/v1/farm.proto"], [PROTO_ROOT])?;
    for field in ["log_power", "band_levels_db"] {
        take_as_it_lies(&mut descriptors, "PassFeatures", field)?;
    }
    tonic_prost_build::configure().bytes(".farm.v1.PassFeatures").compile_fds(descriptors)?;
    Ok(())
}

/// Changes a field of type `repeated double` to `bytes`. The encoding in a message is the same:
/// consecutive little-endian numbers. Decoding the numbers one by one would take a tenth of the time of
/// the farm.
fn take_as_it_lies(
    descriptors: &mut FileDescriptorSet,
    message: &str,
    field: &str,
) -> Result<(), Box<dyn Error>> {
    let messages = descriptors.file.iter_mut().flat_map(|file| &mut file.message_type);
    let mut fields = messages.filter(|it| it.name() == message).flat_map(|it| &mut it.field);
    let found = fields.find(|it| it.name() == field && it.r#type() == Type::Double);
    let found = found.ok_or_else(|| format!("{message} has no numbers {field}"))?;
    found.set_type(Type::Bytes);
    found.set_label(Label::Optional);
    Ok(())
}
