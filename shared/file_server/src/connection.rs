//! One client.

use crate::request::{NoRequest, Request, has_bytes};
use crate::response::{Refusal, refuse, respond};
use crate::site::Site;
use std::io::{self, BufReader, BufWriter, ErrorKind, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Interval at which a connection that waits for its client checks whether the server stops.
const POLL: Duration = Duration::from_millis(200);
/// A connection without requests is closed after this time, to make room for other clients.
const IDLE: Duration = Duration::from_secs(30);
/// Time limit for a complete request, for each piece of a response to be accepted, and for a response beyond the time that
/// it takes at `MIN_RATE`.
const TIMEOUT: Duration = Duration::from_secs(10);
/// Slowest client, bytes per second: an eighth of a slow mobile connection. A slower one would keep a place for hours.
const MIN_RATE: f64 = 16e3;

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
    let mut output = BufWriter::with_capacity(1 << 16, PacedWriter::new(stream));
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
        output.get_mut().begin();
        respond(&mut output, site, &request)?;
        if request.is_last {
            break;
        }
    }
    Ok(())
}

/// The output to a client, which must accept each response at no less than `MIN_RATE`.
struct PacedWriter<W> {
    output: W,
    begun: Instant,
    n_bytes: u64,
}

impl<W: Write> PacedWriter<W> {
    fn new(output: W) -> Self {
        Self { output, begun: Instant::now(), n_bytes: 0 }
    }

    /// Starts a response.
    fn begin(&mut self) {
        self.begun = Instant::now();
        self.n_bytes = 0;
    }
}

impl<W: Write> Write for PacedWriter<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.begun.elapsed() > TIMEOUT + Duration::from_secs_f64(self.n_bytes as f64 / MIN_RATE) {
            return Err(ErrorKind::TimedOut.into());
        }
        let n = self.output.write(bytes)?;
        self.n_bytes += n as u64;
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.output.flush()
    }
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
    fn client_that_accepts_a_response_too_slowly_is_dropped() {
        let mut output = PacedWriter::new(Vec::new());
        output.begun -= TIMEOUT + Duration::from_secs(1);
        assert_eq!(output.write(b"a").expect_err("late").kind(), ErrorKind::TimedOut);
        // What was accepted gives more time.
        output.n_bytes = 2 * MIN_RATE as u64;
        assert_eq!(output.write(b"a").expect("in time"), 1);
        output.begin();
        assert_eq!(output.write(b"a").expect("a new response"), 1);
    }

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
