//! Clients of all kinds.

use crate::support::{PAGE, bytes, connect, exchange, response, with_server};
use std::io::{Read, Write};
use std::net::SocketAddr;
use std::thread;

fn get(address: SocketAddr, target: &str, headers: &str) -> (String, Vec<u8>) {
    let mut stream = connect(address);
    let request = format!("GET {target} HTTP/1.1\r\nHost: localhost\r\n{headers}\r\n");
    stream.write_all(request.as_bytes()).expect("sends");
    response(&mut stream)
}

#[test]
fn contents_have_types_and_lengths() {
    with_server(|address| {
        let (head, body) = get(address, "/", "");
        assert!(head.starts_with("HTTP/1.1 200 OK\r\n") && head.contains("Content-Type: text/html"), "{head}");
        assert_eq!(body, PAGE);
        let (head, body) = get(address, "/cloud.laz?v=2", "");
        assert!(head.contains("Accept-Ranges: bytes\r\n"), "{head}");
        assert_eq!(body, bytes());
        assert_eq!(get(address, "/images/0.jpg", "").1, b"image");
    });
}

#[test]
fn ranges_are_answered_with_their_bytes_or_refused() {
    with_server(|address| {
        let (head, body) = get(address, "/cloud.laz", "Range: bytes=1000-1009\r\n");
        assert!(head.starts_with("HTTP/1.1 206 "), "{head}");
        assert!(head.contains("Content-Range: bytes 1000-1009/100000\r\n"), "{head}");
        assert_eq!(body, bytes()[1000..1010]);
        let (head, body) = get(address, "/cloud.laz", "Range: bytes=-5\r\n");
        assert!(head.contains("Content-Range: bytes 99995-99999/100000\r\n"), "{head}");
        assert_eq!(body, bytes()[99_995..]);
        let (head, body) = get(address, "/cloud.laz", "Range: bytes=100000-\r\n");
        assert!(head.starts_with("HTTP/1.1 416 ") && head.contains("Content-Range: bytes */100000\r\n"), "{head}");
        assert!(body.is_empty());
        let (head, body) = get(address, "/", "Range: bytes=2-8\r\n");
        assert!(head.starts_with("HTTP/1.1 206 "), "{head}");
        assert_eq!(body, PAGE[2..9]);
        // Values that are not a single range are ignored.
        assert!(get(address, "/", "Range: bytes=5-2\r\n").0.starts_with("HTTP/1.1 200 "));
    });
}

#[test]
fn connection_serves_many_requests_and_head_sends_no_body() {
    with_server(|address| {
        let mut stream = connect(address);
        for _ in 0..3 {
            stream.write_all(b"GET /images/0.jpg HTTP/1.1\r\n\r\n").expect("sends");
            assert_eq!(response(&mut stream).1, b"image");
        }
        // Two at once; the response to the first has a length but no body.
        stream
            .write_all(b"HEAD /cloud.laz HTTP/1.1\r\n\r\nGET / HTTP/1.1\r\nConnection: close\r\n\r\n")
            .expect("sends");
        let mut rest = Vec::new();
        stream.read_to_end(&mut rest).expect("ends");
        let rest = String::from_utf8(rest).expect("text");
        let (first, second) = rest.split_once("\r\n\r\n").expect("a head");
        assert!(first.contains("Content-Length: 100000"), "{first}");
        assert!(second.starts_with("HTTP/1.1 200 OK") && second.ends_with("</title>"), "{second}");
    });
}

#[test]
fn names_outside_the_site_do_not_exist() {
    with_server(|address| {
        for target in
            ["/secret", "/../secret", "/images/../secret", "/%2e%2e/secret", "//etc/passwd", "/gone.laz", "/images/"]
        {
            let (head, body) = get(address, target, "");
            assert!(head.starts_with("HTTP/1.1 404 "), "{target}: {head}");
            assert_eq!(body, b"404 Not Found\n");
        }
        let (head, _) = get(address, "/", "Host: evil.example\r\n");
        assert!(head.starts_with("HTTP/1.1 403 "), "{head}");
        let answer = exchange(address, b"POST / HTTP/1.1\r\nContent-Length: 3\r\n\r\nabc");
        let answer = String::from_utf8_lossy(&answer).into_owned();
        assert!(answer.starts_with("HTTP/1.1 405 ") && answer.contains("Allow: GET, HEAD\r\n"), "{answer}");
        assert_eq!(answer.matches("HTTP/1.1").count(), 1, "the body is not a second request: {answer}");
    });
}

#[test]
fn garbage_and_huge_headers_end_their_connection_only() {
    with_server(|address| {
        let huge = [b"GET / HTTP/1.1\r\nCookie: ".to_vec(), vec![b'a'; 1 << 20]].concat();
        let garbage: Vec<u8> = (0..4096_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
        for (sent, expected) in [
            (&b"\r\n\r\n"[..], "HTTP/1.1 400 "),
            (b"GET / HTTP/9.9\r\n\r\n", "HTTP/1.1 400 "),
            (b"\x16\x03\x01\x02\x00\x01\x00\x01\r\n\r\n", "HTTP/1.1 400 "),
            (b"GET / HTTP", ""),
            (&[], ""),
        ] {
            let answer = exchange(address, sent);
            let answer = String::from_utf8_lossy(&answer);
            assert!(answer.starts_with(expected) && answer.is_empty() == expected.is_empty(), "{sent:?}: {answer}");
        }
        // The reset of the connection may arrive before the response.
        for sent in [huge, garbage] {
            let answer = exchange(address, &sent);
            let answer = String::from_utf8_lossy(&answer).into_owned();
            assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 4"), "{answer}");
        }
        assert_eq!(get(address, "/", "").1, PAGE, "the server goes on");
    });
}

#[test]
fn clients_are_served_at_once_and_a_silent_one_holds_up_no_other() {
    with_server(|address| {
        let silent = connect(address);
        thread::scope(|scope| {
            for first in 0..8_usize {
                scope.spawn(move || {
                    let mut stream = connect(address);
                    for begin in (first..100_000).step_by(9973) {
                        let end = (begin + 4999).min(99_999);
                        let request = format!("GET /cloud.laz HTTP/1.1\r\nRange: bytes={begin}-{end}\r\n\r\n");
                        stream.write_all(request.as_bytes()).expect("sends");
                        assert_eq!(response(&mut stream).1, bytes()[begin..=end]);
                    }
                });
            }
        });
        drop(silent);
    });
}

#[test]
fn client_beyond_the_limit_is_refused_until_another_leaves() {
    with_server(|address| {
        let mut clients: Vec<_> = (0..32).map(|_| connect(address)).collect();
        for stream in &mut clients {
            stream.write_all(b"GET / HTTP/1.1\r\n\r\n").expect("sends");
            assert_eq!(response(stream).1, PAGE);
        }
        let (head, _) = response(&mut connect(address));
        assert!(head.starts_with("HTTP/1.1 503 "), "{head}");
        clients.clear();
        // The threads of the clients need a moment to notice it.
        let is_served = |_: &usize| exchange(address, b"GET / HTTP/1.1\r\n\r\n").starts_with(b"HTTP/1.1 200 ");
        assert!((0..1000).find(is_served).is_some());
    });
}
