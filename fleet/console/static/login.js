// The login page: name and password for a session, whose cookie is not readable by scripts.

const form = document.getElementById("login");
const words = document.getElementById("login-words");
const name = document.getElementById("name");
const password = document.getElementById("password");
const WITHIN = 20000; // ms; logins are verified one after the other

async function logIn() {
  const body = JSON.stringify({ name: name.value, password: password.value });
  const headers = { "Content-Type": "application/json" };
  const answer = await fetch("/api/login", { method: "POST", headers, body, signal: AbortSignal.timeout(WITHIN) });
  const told = await answer.json();
  if (!answer.ok) throw new Error(told.error);
  localStorage.setItem("proof", told.proof);
  location.replace(`/${location.hash}`); // what is in it is a moment of the past
}

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  const button = form.querySelector("button");
  button.disabled = true;
  words.textContent = "";
  try {
    await logIn();
  } catch (error) {
    words.textContent = error instanceof TypeError || error.name === "TimeoutError" ? "The console does not answer. Try again." : error.message;
    password.value = "";
    password.focus();
  }
  button.disabled = false;
});
name.focus();
