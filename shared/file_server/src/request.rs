//! The head of a request: its first line and its headers.

use std::io::{self, BufRead, ErrorKind};

/// Largest head, bytes. Browsers send less than 2 kB; cookies of other servers on the same host may be included.
pub(crate) const MAX_HEAD_BYTES: usize = 16 * 1024;

/// A parsed request.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Request {
    /// Method as sent, such as `GET`.
    pub(crate) method: String,
    /// Path without its first slash and without the query.
    pub(crate) name: String,
    pub(crate) host: Option<String>,
    pub(crate) range: Option<String>,
    /// Whether the connection ends after the response.
    pub(crate) is_last: bool,
}

/// Reason why there is no request.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum NoRequest {
    /// The connection has ended, or the head was not complete in time.
    Closed,
    /// The bytes are not a request.
    Invalid,
    TooLarge,
}

impl Request {
    /// Reads one head. `is_late` is called before each piece: a client may send one byte at a time.
    pub(crate) fn read(input: &mut impl BufRead, is_late: impl Fn() -> bool) -> Result<Self, NoRequest> {
        let head = read_head(input, is_late)?;
        let head = std::str::from_utf8(&head).map_err(|_| NoRequest::Invalid)?;
        Self::parse(head).ok_or(NoRequest::Invalid)
    }

    fn parse(head: &str) -> Option<Self> {
        let mut lines = head.lines();
        let mut words = lines.next()?.split(' ');
        let method = words.next()?;
        let target = words.next()?;
        let version = words.next()?;
        let is_current = match version {
            "HTTP/1.1" => true,
            "HTTP/1.0" => false,
            _ => return None,
        };
        if words.next().is_some() || method.is_empty() {
            return None;
        }
        let path = target.strip_prefix('/')?;
        let name = path.split(['?', '#']).next()?.to_owned();
        let mut request = Self { method: method.to_owned(), name, is_last: !is_current, ..Self::default() };
        for line in lines {
            let (name, value) = line.split_once(':')?;
            let value = value.trim();
            match name.to_ascii_lowercase().as_str() {
                "host" => request.host = Some(value.to_owned()),
                "range" => request.range = Some(value.to_owned()),
                "connection" if value.eq_ignore_ascii_case("close") => request.is_last = true,
                // The body would be mistaken for the next request.
                "content-length" if value != "0" => request.is_last = true,
                "transfer-encoding" => request.is_last = true,
                _ => {}
            }
        }
        Some(request)
    }
}

/// The bytes before the first empty line.
fn read_head(input: &mut impl BufRead, is_late: impl Fn() -> bool) -> Result<Vec<u8>, NoRequest> {
    let mut head = Vec::new();
    while !is_late() {
        let bytes = match input.fill_buf() {
            Ok([]) => return Err(NoRequest::Closed),
            Ok(bytes) => bytes,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(_) => return Err(NoRequest::Closed),
        };
        let n_before = head.len();
        head.extend_from_slice(bytes);
        // The empty line may begin in the previous bytes.
        let searched = n_before.saturating_sub(3);
        let end = head[searched..].windows(4).position(|four| four == b"\r\n\r\n").map(|at| searched + at);
        let n_bytes = bytes.len();
        if let Some(end) = end.filter(|end| *end <= MAX_HEAD_BYTES) {
            input.consume(end + 4 - n_before);
            head.truncate(end);
            return Ok(head);
        }
        input.consume(n_bytes);
        if head.len() > MAX_HEAD_BYTES {
            return Err(NoRequest::TooLarge);
        }
    }
    Err(NoRequest::Closed)
}

/// Waits for the first byte of the client: used between requests.
pub(crate) fn has_bytes(input: &mut impl BufRead) -> io::Result<bool> {
    input.fill_buf().map(|bytes| !bytes.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::BufReader;

    fn parsed(head: &str) -> Result<Request, NoRequest> {
        // Small pieces: the empty line may lie across them.
        Request::read(&mut BufReader::with_capacity(3, head.as_bytes()), || false)
    }

    #[test]
    fn head_is_read_whatever_its_pieces_are() {
        let head = "GET /a/b.laz?v=1 HTTP/1.1\r\nHost: localhost:80\r\nRANGE:  bytes=0-1 \r\n\r\nGET /next";
        let mut input = BufReader::with_capacity(7, head.as_bytes());
        let request = Request::read(&mut input, || false).expect("is a request");
        assert_eq!(request.method, "GET");
        assert_eq!((request.name.as_str(), request.range.as_deref()), ("a/b.laz", Some("bytes=0-1")));
        assert_eq!((request.host.as_deref(), request.is_last), (Some("localhost:80"), false));
        let mut rest = String::new();
        io::Read::read_to_string(&mut input, &mut rest).expect("text");
        assert_eq!(rest, "GET /next", "the next request stays");
    }

    #[test]
    fn connection_ends_after_old_versions_bodies_and_on_request() {
        for (head, is_last) in [
            ("GET / HTTP/1.1\r\n\r\n", false),
            ("GET / HTTP/1.0\r\n\r\n", true),
            ("GET / HTTP/1.1\r\nConnection: Close\r\n\r\n", true),
            ("GET / HTTP/1.1\r\nContent-Length: 3\r\n\r\nabc", true),
            ("GET / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n", true),
        ] {
            assert_eq!(parsed(head).expect("is a request").is_last, is_last, "{head:?}");
        }
    }

    #[test]
    fn garbage_is_invalid_and_endless_headers_are_too_large() {
        for head in [
            "\r\n\r\n",
            "GET\r\n\r\n",
            "GET / HTTP/2\r\n\r\n",
            "GET a HTTP/1.1\r\n\r\n",
            "GET / HTTP/1.1\r\nno colon\r\n\r\n",
        ] {
            assert_eq!(parsed(head), Err(NoRequest::Invalid), "{head:?}");
        }
        assert_eq!(Request::read(&mut &b"\xff\xfe / HTTP/1.1\r\n\r\n"[..], || false), Err(NoRequest::Invalid));
        assert_eq!(parsed("GET / HTTP/1.1\r\nHost"), Err(NoRequest::Closed));
        assert_eq!(parsed(&"a".repeat(MAX_HEAD_BYTES + 8)), Err(NoRequest::TooLarge));
        assert_eq!(Request::read(&mut &b"GET / HTTP/1.1\r\n\r\n"[..], || true), Err(NoRequest::Closed));
    }
}
