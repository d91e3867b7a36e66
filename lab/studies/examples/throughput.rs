//! Bandwidth and round-trip time of the link, for `lab/peers/link.py`.
//!
//! `throughput listen HOST:PORT KEY` serves one connection; `throughput connect HOST:PORT KEY MEGABYTES` prints MB/s, then the
//! median round-trip time of a message of 64 bytes, in microseconds.

use link::{Key, accept, connect};
use std::io::{Error, Read, Write};
use std::net::TcpListener;
use std::path::Path;
use std::time::Instant;

/// Bytes of a message of the round trips; the first 8 of them have the number of bytes that follow it.
const SMALL: usize = 64;
const ROUND_TRIPS: usize = 1000;
/// Bytes that are written at a time.
const PIECE: usize = 1 << 20;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["listen", address, key] => listen(address, &Key::read(Path::new(key))?),
        ["connect", address, key, megabytes] => measure(address, &Key::read(Path::new(key))?, megabytes.parse()?),
        _ => Err("listen HOST:PORT KEY, or connect HOST:PORT KEY MEGABYTES".into()),
    }
}

/// Answers each message when the bytes that it announces have arrived.
fn listen(address: &str, key: &Key) -> Result<(), Box<dyn std::error::Error>> {
    let (stream, _) = TcpListener::bind(address)?.accept()?;
    let (mut sender, mut receiver) = accept(stream, key)?;
    let mut message = [0; SMALL];
    while receiver.read_exact(&mut message).is_ok() {
        let mut n_left = u64::from_le_bytes(message[..8].try_into()?);
        while n_left > 0 {
            let n_read = receiver.next_bytes()?.len() as u64;
            n_left = n_left.checked_sub(n_read).filter(|_| n_read > 0).ok_or_else(|| Error::other("other bytes"))?;
        }
        sender.write_all(&message)?;
        sender.flush()?;
    }
    Ok(())
}

fn measure(address: &str, key: &Key, megabytes: usize) -> Result<(), Box<dyn std::error::Error>> {
    let (mut sender, mut receiver) = connect(address, key)?;
    let mut message = [0; SMALL];
    let mut round_trip = |n_bytes: usize| -> Result<f64, Error> {
        let begun = Instant::now();
        message[..8].copy_from_slice(&(n_bytes as u64).to_le_bytes());
        sender.write_all(&message)?;
        // A separate message: the following bytes are counted by messages.
        sender.flush()?;
        let piece = vec![7; PIECE];
        for start in (0..n_bytes).step_by(PIECE) {
            sender.write_all(&piece[..PIECE.min(n_bytes - start)])?;
        }
        sender.flush()?;
        receiver.read_exact(&mut [0; SMALL])?;
        Ok(begun.elapsed().as_secs_f64())
    };
    let seconds = round_trip(megabytes * 1_000_000)?;
    let mut times = (0..ROUND_TRIPS).map(|_| round_trip(0)).collect::<Result<Vec<f64>, Error>>()?;
    times.sort_by(f64::total_cmp);
    println!("{:.0} {:.1}", megabytes as f64 / seconds, times[ROUND_TRIPS / 2] * 1e6);
    Ok(())
}
