use super::ITERATIONS;
use prost::Message as _;
use tracktwin_protocol::farm::{LeaseResponse, RegisterRequest, ReportRequest};
use tracktwin_protocol::{CaseReport, Lease, Registration, Shape};

/// Decodes bytes as a message; the first byte selects its type.
fn take(kind: u8, bytes: &[u8]) {
    match kind % 3 {
        0 => {
            let registration = RegisterRequest::decode(bytes).ok().map(Registration::try_from);
            drop(registration);
        }
        1 => {
            let lease = LeaseResponse::decode(bytes).ok().map(Lease::try_from);
            drop(lease);
        }
        _ => {
            let Ok(report) = ReportRequest::decode(bytes) else { return };
            for case in report.cases {
                drop(CaseReport::checked(case, &shape()));
            }
        }
    }
}

/// Shape of the features of a campaign with two speeds and three frequencies.
fn shape() -> Shape {
    Shape { speeds_km_h: vec![10.0, 13.0], bins: 3 }
}

#[test]
fn a_message_is_understood_or_refused() {
    bolero::check!(name = "messages").with_iterations(ITERATIONS).for_each(|bytes: &[u8]| {
        if let Some((kind, message)) = bytes.split_first() {
            take(*kind, message);
        }
    });
}
