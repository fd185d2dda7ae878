// A control by other hands: node server.js PORT. Lines on stdin change it; every correction that arrives is printed.
const { OPCUAServer, DataType, Variant, StatusCodes } = require("node-opcua");

(async () => {
  const values = { T1: 20.0, T2: 20.0, Z: 0.0 };
  let bad = false, refusing = false;
  const server = new OPCUAServer({ port: Number(process.argv[2]) });
  await server.initialize();
  const space = server.engine.addressSpace.getOwnNamespace();
  const device = space.addObject({ organizedBy: server.engine.addressSpace.rootFolder.objects, browseName: "lathe" });
  for (const name of ["T1", "T2", "Z"]) {
    const kind = name === "Z" ? DataType.Float : DataType.Double;
    space.addVariable({
      componentOf: device, browseName: name, nodeId: `s=${name}`, dataType: DataType[kind],
      accessLevel: "CurrentRead | CurrentWrite", userAccessLevel: "CurrentRead | CurrentWrite",
      minimumSamplingInterval: 100,
      value: {
        get: () => (name === "T1" && bad ? StatusCodes.BadSensorFailure
          : new Variant({ dataType: kind, value: values[name] })),
        set: (given) => {
          if (refusing || name !== "Z") return StatusCodes.BadUserAccessDenied;
          values.Z = given.value;
          console.log(`arrived ${DataType[given.dataType]} ${given.value}`);
          return StatusCodes.Good;
        },
      },
    });
  }
  await server.start();
  console.log("started");
  require("readline").createInterface({ input: process.stdin }).on("line", (line) => {
    const [name, value] = line.split(" ");
    if (name === "bad") bad = value === "1";
    else if (name === "refusing") refusing = value === "1";
    else values[name] = Number(value);
    console.log("done");
  });
})();
