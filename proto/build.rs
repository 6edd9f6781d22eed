//! Generates the wire types with a protobuf compiler written in Rust: no `protoc` is needed.

use std::path::Path;

use prost::Message;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo:rerun-if-changed=cluster.proto");
    let descriptors = protox::compile(["cluster.proto"], ["."])?;
    // What the generated types are made from, to be told to whoever asks.
    let all = Path::new(&std::env::var("OUT_DIR")?).join("descriptors.bin");
    std::fs::write(all, descriptors.encode_to_vec())?;
    tonic_prost_build::configure()
        // Payloads are shared, not copied.
        .bytes(".horma.cluster.v1")
        .compile_fds(descriptors)?;
    Ok(())
}
