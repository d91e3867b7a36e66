//! The server and raw sockets.

mod clients;
mod support;
