//! Generates the wire types with a protobuf compiler written in Rust: no `protoc` is needed.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo:rerun-if-changed=cluster.proto");
    let descriptors = protox::compile(["cluster.proto"], ["."])?;
    tonic_prost_build::configure()
        // Payloads are shared, not copied.
        .bytes(".horma.cluster.v1")
        .compile_fds(descriptors)?;
    Ok(())
}
