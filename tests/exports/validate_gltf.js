// Prints what Khronos' validator says of each file, one line of JSON each: [{code, severity, message, pointer}, ...].
// Use: node validate_gltf.js FILE...   with the package `gltf-validator` where Node finds it.
const fs = require("fs");
const validator = require("gltf-validator");

async function main(paths) {
  for (const path of paths) {
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(path)), { maxIssues: 0 });
    console.log(JSON.stringify(report.issues.messages));
  }
}

main(process.argv.slice(2)).catch((error) => {
  console.error(error);
  process.exit(1);
});
