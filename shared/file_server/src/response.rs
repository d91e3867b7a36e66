//! Responses.

use crate::range::Range;
use crate::request::Request;
use crate::site::Site;
use std::fmt::Write as _;
use std::io::{self, Write};

/// Statuses with a short text instead of a content.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Refusal {
    BadRequest,
    ForeignHost,
    NotFound,
    MethodNotAllowed,
    HeadTooLarge,
    TooManyConnections,
}

impl Refusal {
    fn status(self) -> &'static str {
        match self {
            Self::BadRequest => "400 Bad Request",
            Self::ForeignHost => "403 Forbidden",
            Self::NotFound => "404 Not Found",
            Self::MethodNotAllowed => "405 Method Not Allowed",
            Self::HeadTooLarge => "431 Request Header Fields Too Large",
            Self::TooManyConnections => "503 Service Unavailable",
        }
    }
}

/// Sends a refusal.
pub(crate) fn refuse(output: &mut impl Write, refusal: Refusal, is_last: bool) -> io::Result<()> {
    let status = refusal.status();
    let allow = if matches!(refusal, Refusal::MethodNotAllowed) { "Allow: GET, HEAD\r\n" } else { "" };
    let connection = if is_last { "Connection: close\r\n" } else { "" };
    let n_bytes = status.len() + 1;
    write!(
        output,
        "HTTP/1.1 {status}\r\nContent-Type: text/plain\r\nContent-Length: {n_bytes}\r\n{allow}{connection}\r\n{status}\n"
    )?;
    output.flush()
}

/// Sends the requested content.
pub(crate) fn respond(output: &mut impl Write, site: &Site, request: &Request) -> io::Result<()> {
    let has_body = match request.method.as_str() {
        "GET" => true,
        "HEAD" => false,
        _ => return refuse(output, Refusal::MethodNotAllowed, request.is_last),
    };
    let found = site.find(&request.name).and_then(|(name, content)| Some((name, content.open()?)));
    let Some((name, mut content)) = found else { return refuse(output, Refusal::NotFound, request.is_last) };
    let n_bytes = content.n_bytes();
    let range = Range::parse(request.range.as_deref(), n_bytes);
    let (status, (begin, end)) = match range {
        Range::Whole => ("200 OK", (0, n_bytes)),
        Range::Part(begin, end) => ("206 Partial Content", (begin, end)),
        Range::Unsatisfiable => ("416 Range Not Satisfiable", (0, 0)),
    };
    // A cached page could show the run that used this address earlier.
    let mut head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {}\r\nContent-Length: {}\r\nAccept-Ranges: bytes\r\nCache-Control: no-cache\r\n\
         X-Content-Type-Options: nosniff\r\n",
        media_type(name),
        end - begin
    );
    // Writing to a string cannot fail.
    let _ = match range {
        Range::Whole => Ok(()),
        Range::Part(begin, end) => write!(head, "Content-Range: bytes {begin}-{}/{n_bytes}\r\n", end - 1),
        Range::Unsatisfiable => write!(head, "Content-Range: bytes */{n_bytes}\r\n"),
    };
    head.push_str(if request.is_last { "Connection: close\r\n\r\n" } else { "\r\n" });
    output.write_all(head.as_bytes())?;
    if has_body && begin < end {
        let n_sent = io::copy(&mut content.reader(begin, end)?, output)?;
        if n_sent != end - begin {
            // The file became shorter: the client must not mistake the next response for the rest of this one.
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
    }
    output.flush()
}

fn media_type(name: &str) -> &'static str {
    match name.rsplit_once('.').map(|(_, ending)| ending) {
        Some("html") => "text/html; charset=utf-8",
        Some("txt") => "text/plain; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("json") => "application/json",
        Some("wasm") => "application/wasm",
        Some("jpg") => "image/jpeg",
        Some("png") => "image/png",
        _ => "application/octet-stream",
    }
}
