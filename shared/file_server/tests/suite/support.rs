//! A running server, and a client that reads its responses.

use file_server::{Content, Server, Site};
use std::borrow::Cow;
use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

pub const PAGE: &[u8] = b"<!DOCTYPE html><title>a</title>";

/// Runs `test` with the address of a server of a page and of a file of 100 000 bytes, whose byte `i` is `i % 251`.
pub fn with_server(test: impl FnOnce(SocketAddr)) {
    let folder = tempfile::tempdir().expect("a folder");
    let file: PathBuf = folder.path().join("cloud.laz");
    std::fs::write(&file, bytes()).expect("writes");
    std::fs::write(folder.path().join("secret"), b"secret").expect("writes");
    let mut site = Site::default();
    site.add("index.html", Content::Bytes(Cow::Borrowed(PAGE)));
    site.add("cloud.laz", Content::File(file.clone()));
    site.add("gone.laz", Content::File(file.with_file_name("gone.laz")));
    site.add("images/0.jpg", Content::OnRequest(Box::new(|| Some(b"image".to_vec()))));
    let server = Server::bind(SocketAddr::from(([127, 0, 0, 1], 0))).expect("binds");
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        let runner = scope.spawn(|| server.run(&site, || stop.load(Ordering::Relaxed)));
        // Also stops the server after a failed test, which would otherwise wait for it.
        let stopper = Stopper(&stop);
        test(server.address());
        drop(stopper);
        runner.join().expect("no panic");
    });
}

struct Stopper<'a>(&'a AtomicBool);

impl Drop for Stopper<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

pub fn bytes() -> Vec<u8> {
    (0..100_000_u32).map(|i| (i % 251) as u8).collect()
}

pub fn connect(address: SocketAddr) -> TcpStream {
    let stream = TcpStream::connect(address).expect("connects");
    stream.set_read_timeout(Some(Duration::from_secs(20))).expect("sets");
    stream
}

/// Sends bytes, closes the sending side, and returns the complete response.
pub fn exchange(address: SocketAddr, sent: &[u8]) -> Vec<u8> {
    let mut stream = connect(address);
    // The server may have closed already.
    let _ = stream.write_all(sent);
    let _ = stream.shutdown(Shutdown::Write);
    let mut answer = Vec::new();
    // A connection that is closed before all bytes are read ends with a reset.
    let _ = stream.read_to_end(&mut answer);
    answer
}

/// One response of a connection that stays open: head and body.
pub fn response(stream: &mut impl Read) -> (String, Vec<u8>) {
    let mut head = Vec::new();
    while !head.ends_with(b"\r\n\r\n") {
        let mut byte = [0];
        stream.read_exact(&mut byte).expect("a byte");
        head.push(byte[0]);
    }
    let head = String::from_utf8(head).expect("text");
    let length = head.lines().find_map(|line| line.strip_prefix("Content-Length: ")).expect("a length");
    let mut body = vec![0; length.parse().expect("a number")];
    stream.read_exact(&mut body).expect("the body");
    (head, body)
}
