//! Checks the token of every call.

use super::peer::Caller;
use tonic::service::Interceptor;
use tonic::{Request, Status};

/// Admits calls that have the token.
#[derive(Clone)]
pub struct Guard {
    /// Hash of the token. A comparison of hashes reveals nothing about the token by its duration.
    token: Option<blake3::Hash>,
}

impl Guard {
    /// Creates a guard that requires this token; without token it admits every call.
    pub fn new(token: Option<&str>) -> Self {
        Self { token: token.map(|token| blake3::hash(token.trim().as_bytes())) }
    }

    /// Whether a call with this `authorization` header is admitted.
    pub fn admits(&self, header: Option<&[u8]>) -> bool {
        let shown = header.and_then(|header| header.strip_prefix(b"Bearer "));
        self.token.is_none_or(|token| shown.is_some_and(|shown| blake3::hash(shown) == token))
    }
}

impl Interceptor for Guard {
    fn call(&mut self, request: Request<()>) -> Result<Request<()>, Status> {
        let header = request.metadata().get("authorization");
        let caller = request.extensions().get::<Caller>();
        if self.admits(header.map(tonic::metadata::MetadataValue::as_bytes)) {
            caller.inspect(|caller| caller.admit());
            return Ok(request);
        }
        let peer = caller.map_or_else(|| "unknown".to_owned(), |caller| caller.address.to_string());
        let fault = if header.is_some() { "the token is wrong" } else { "the token is missing" };
        tracing::warn!(peer, "call refused: {fault}");
        Err(Status::permission_denied(format!("{fault}; use --token-file with the worker")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_token_opens_the_door_and_none_where_none_is_demanded() {
        let guard = Guard::new(Some("s3cret\n"));
        assert!(guard.admits(Some(b"Bearer s3cret")));
        for wrong in [None, Some(&b"Bearer s3cre"[..]), Some(b"s3cret"), Some(b"Bearer ")] {
            assert!(!guard.admits(wrong), "{wrong:?}");
        }
        assert!(Guard::new(None).admits(None));
    }
}
