//! Tests of towns through the public interface.

mod materials;
