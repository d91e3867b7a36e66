//! One client.

use crate::request::{NoRequest, Request, has_bytes};
use crate::response::{Refusal, refuse, respond};
use crate::site::Site;
use std::io::{self, BufReader, BufWriter, ErrorKind};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Interval at which a connection that waits for its client checks whether the server stops.
const POLL: Duration = Duration::from_millis(200);
/// A connection without requests is closed after this time, to make room for other clients.
const IDLE: Duration = Duration::from_secs(30);
/// Time limit for a complete request, and for each piece of a response to be accepted.
const TIMEOUT: Duration = Duration::from_secs(10);

/// Host names that a client may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Hosts {
    /// Only the names of loopback. A page of another site whose name resolves to loopback must not read the served content.
    Loopback,
    Any,
}

impl Hosts {
    fn allow(self, host: Option<&str>) -> bool {
        let Some(host) = host.filter(|_| self == Self::Loopback) else { return true };
        let has_port = |name: &str, rest: &str| rest.is_empty() || (rest.starts_with(':') && !name.is_empty());
        ["localhost", "127.0.0.1", "[::1]"]
            .iter()
            .any(|name| host.strip_prefix(name).is_some_and(|rest| has_port(name, rest)))
    }
}

/// Answers the requests of a client until the client sends no more, breaks the protocol, or the server stops.
pub(crate) fn serve(stream: &TcpStream, site: &Site, hosts: Hosts, is_stopped: impl Fn() -> bool) -> io::Result<()> {
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(TIMEOUT))?;
    let mut input = BufReader::new(stream);
    let mut output = BufWriter::with_capacity(1 << 16, stream);
    while wait(&mut input, stream, &is_stopped)? {
        stream.set_read_timeout(Some(TIMEOUT))?;
        let begin = Instant::now();
        let request = match Request::read(&mut input, || begin.elapsed() > TIMEOUT) {
            Ok(request) => request,
            Err(NoRequest::Closed) => return Ok(()),
            Err(NoRequest::Invalid) => return refuse(&mut output, Refusal::BadRequest, true),
            Err(NoRequest::TooLarge) => return refuse(&mut output, Refusal::HeadTooLarge, true),
        };
        if !hosts.allow(request.host.as_deref()) {
            return refuse(&mut output, Refusal::ForeignHost, true);
        }
        respond(&mut output, site, &request)?;
        if request.is_last {
            break;
        }
    }
    Ok(())
}

/// Waits for the first byte of a request. False if no byte arrived.
fn wait(input: &mut BufReader<&TcpStream>, stream: &TcpStream, is_stopped: impl Fn() -> bool) -> io::Result<bool> {
    stream.set_read_timeout(Some(POLL))?;
    let begin = Instant::now();
    while begin.elapsed() < IDLE && !is_stopped() {
        match has_bytes(input) {
            Err(error)
                if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
            other => return other,
        }
    }
    Ok(false)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_only_resolve_to_loopback_are_refused() {
        for host in ["localhost", "localhost:8000", "127.0.0.1:1", "[::1]:80"] {
            assert!(Hosts::Loopback.allow(Some(host)), "{host}");
        }
        for host in ["evil.example", "localhost.evil.example", "127.0.0.1.evil.example:80", ""] {
            assert!(!Hosts::Loopback.allow(Some(host)), "{host}");
            assert!(Hosts::Any.allow(Some(host)));
        }
        assert!(Hosts::Loopback.allow(None), "HTTP/1.0");
    }
}
