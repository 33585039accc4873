//! Interfaces for users and for other versions of the program: arguments, and messages of the farm.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto};
use std::fmt::Write as _;
use std::process::Command;
use system_tests::run;
use test_needs::assert_snapshot;

const PROGRAM: &str = env!("CARGO_BIN_EXE_tracktwin-under-test");
const WORKER: &str = env!("CARGO_BIN_EXE_tracktwin-worker-under-test");

/// The help of a command, independent of the environment.
fn help(program: &str, command: &[String]) -> String {
    let said = Command::new(program).args(command).arg("--help").env_clear().output().unwrap();
    assert!(said.status.success(), "{command:?}");
    String::from_utf8(said.stdout).unwrap()
}

/// Names of the subcommands of a command, as listed in its help.
fn commands(help: &str) -> Vec<String> {
    let list = help.split_once("\nCommands:\n").map_or("", |(_, list)| list);
    let lines = list.lines().take_while(|line| !line.is_empty());
    let entries = lines.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    let names = entries.filter_map(|line| line.split_whitespace().next());
    names.filter(|name| *name != "help").map(str::to_owned).collect()
}

/// Help of a command and of all its subcommands, each under its name.
fn all_help(program: &str, name: &str, command: &[String]) -> String {
    let help = help(program, command);
    let mut text = format!("# {}\n\n{help}\n", [&[name.to_owned()], command].concat().join(" "));
    for below in commands(&help) {
        text += &all_help(program, name, &[command, &[below]].concat());
    }
    text
}

#[test]
fn arguments_are_those_that_are_kept() {
    let text = all_help(PROGRAM, "tracktwin", &[]);
    assert!(text.matches("\n# ").count() > 20, "few commands were found");
    assert_snapshot("help.txt", &text);
    assert_snapshot("worker-help.txt", &all_help(WORKER, "tracktwin-worker", &[]));
}

/// Names of the manual pages of a command and of all its subcommands.
fn pages(program: &str, name: &str, command: &[String]) -> Vec<String> {
    let page = [&[name.to_owned()], command].concat().join("-") + ".1";
    let below = commands(&help(program, command)).into_iter();
    let pages = below.flat_map(|below| pages(program, name, &[command, &[below]].concat()));
    std::iter::once(page).chain(pages).collect()
}

#[test]
fn every_command_has_a_manual_page() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    run(PROGRAM, &["manual", "--out", &out]).succeeded();
    let pages = pages(PROGRAM, "tracktwin", &[]);
    assert!(pages.len() > 20, "few commands were found: {pages:?}");
    for name in pages {
        let page = std::fs::read_to_string(folder.path().join(&name)).unwrap_or_default();
        assert!(page.contains(".SH SYNOPSIS"), "{name}: {page}");
    }
}

/// Text of a field: number, cardinality, type, name.
fn field(field: &FieldDescriptorProto) -> String {
    let often = match (field.label(), field.proto3_optional(), field.oneof_index) {
        (Label::Repeated, ..) => "repeated ",
        (_, true, _) => "optional ",
        (_, false, Some(_)) => "one of ",
        _ => "",
    };
    let kind = match field.r#type() {
        Type::Message | Type::Enum => field.type_name().to_owned(),
        other => other.as_str_name().trim_start_matches("TYPE_").to_lowercase(),
    };
    format!("  {} {often}{kind} {}\n", field.number(), field.name())
}

fn message(text: &mut String, scope: &str, message: &DescriptorProto) {
    let name = format!("{scope}.{}", message.name());
    writeln!(text, "message {name}").unwrap();
    let mut fields: Vec<_> = message.field.iter().collect();
    fields.sort_by_key(|field| field.number());
    text.extend(fields.into_iter().map(field));
    for range in &message.reserved_range {
        writeln!(text, "  reserved {} to {}", range.start(), range.end() - 1).unwrap();
    }
    message.nested_type.iter().for_each(|nested| self::message(text, &name, nested));
}

#[test]
fn messages_are_those_that_are_kept() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../proto");
    let files = protox::compile(["farm/v1/farm.proto"], [root]).unwrap().file;
    let mut text = String::new();
    for file in &files {
        file.message_type.iter().for_each(|it| message(&mut text, file.package(), it));
        for service in &file.service {
            for method in &service.method {
                let (name, service) = (method.name(), service.name());
                let (takes, gives) = (method.input_type(), method.output_type());
                writeln!(text, "call {service}/{name} {takes} {gives}").unwrap();
            }
        }
    }
    assert_snapshot("messages.txt", &text);
}
