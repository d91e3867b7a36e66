//! Packets that the kernel threw away because nobody took them in time.

use std::net::UdpSocket;

/// What the kernel lists of its UDP sockets.
const TABLE: &str = "/proc/net/udp";

/// How many packets a socket has lost since it was bound; `None` where the kernel does not say.
pub(crate) fn dropped(socket: &UdpSocket) -> Option<u64> {
    let inode = rustix::fs::fstat(socket).ok()?.st_ino;
    of_table(&std::fs::read_to_string(TABLE).ok()?, inode)
}

/// Column `drops` of the line whose column `inode` is that of the socket.
fn of_table(table: &str, inode: u64) -> Option<u64> {
    let columns = |line: &str| -> Option<(u64, u64)> {
        let mut columns = line.split_whitespace();
        Some((columns.nth(9)?.parse().ok()?, columns.nth(2)?.parse().ok()?))
    };
    table.lines().filter_map(columns).find(|(of, _)| *of == inode).map(|(_, drops)| drops)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_nobody_takes_is_counted() {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("binds");
        if !std::path::Path::new(TABLE).exists() {
            eprintln!("skipped: no {TABLE}");
            return;
        }
        assert_eq!(dropped(&socket), Some(0));
        let (sender, address) = (UdpSocket::bind("127.0.0.1:0").expect("binds"), socket.local_addr().expect("bound"));
        // Far more than any default buffer holds.
        let n_sent = 20_000;
        for _ in 0..n_sent {
            sender.send_to(&[0; 1206], address).expect("sends");
        }
        socket.set_nonblocking(true).expect("sets");
        let mut n_received = 0;
        while socket.recv(&mut [0; 2048]).is_ok() {
            n_received += 1;
        }
        assert!(n_received < n_sent);
        assert_eq!(dropped(&socket), Some(n_sent - n_received));
    }
}
