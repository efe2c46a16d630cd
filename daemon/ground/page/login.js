// Sends name and password; the answer sets the session cookie.
const form = document.getElementById("login");
form.addEventListener("submit", async (event) => {
  event.preventDefault();
  const given = Object.fromEntries(new FormData(form));
  const answer = await fetch("/login", { method: "POST", body: JSON.stringify(given) });
  if (answer.ok) {
    location.replace("/");
  } else {
    document.getElementById("error").textContent = (await answer.json()).error;
    form.password.select();
  }
});
