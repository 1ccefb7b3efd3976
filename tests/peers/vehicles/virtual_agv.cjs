// The virtual vehicle of vda-5050-lib, as its own documentation starts it: VDA 5050 2.0.
//
//   node virtual_agv.cjs NODE_MODULES PORT MANUFACTURER SERIAL MAP
"use strict";

const [modules, port, manufacturer, serialNumber, mapId] = process.argv.slice(2);
const { AgvController, VirtualAgvAdapter } = require(`${modules}/vda-5050-lib`);

const controller = new AgvController(
    { manufacturer, serialNumber },
    { interfaceName: "uagv", transport: { brokerUrl: `mqtt://127.0.0.1:${port}` }, vdaVersion: "2.0.0" },
    { agvAdapterType: VirtualAgvAdapter, publishVisualizationInterval: 100 },
    { initialPosition: { mapId, x: 0, y: 0, theta: 0, lastNodeId: "0" }, vehicleSpeed: 0.8, tickRate: 50 },
);
controller.start().then(() => console.log("ready"), error => { console.error(error); process.exit(1); });
